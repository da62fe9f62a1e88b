//! Weights of a network and of LPIPS, read from safetensors.
//!
//! Tensors have the names of the published files: `features.N.weight` and `.bias` as in torchvision, and
//! `linN.model.1.weight` as in the `lpips` package. The metadata key `network` is `vgg` or `alex`. Without this key the
//! shape of the first layer tells the network. Other tensors are ignored. `scripts/lpips_weights.py` writes such files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use safetensors::{Dtype, SafeTensors};

use super::Lpips;
use super::network::Network;
use lexisplat_compress::{Error, Result};

/// Largest file that is read, in bytes. VGG16 with all its layers has 0.55 GB.
const MAX_BYTES: u64 = 1 << 30;
/// Metadata key that names the network.
const NETWORK_KEY: &str = "network";
/// Tensor whose shape distinguishes the networks.
const FIRST_TENSOR: &str = "features.0.weight";
/// Advice for a file that cannot be used.
const ADVICE: &str = "scripts/lpips_weights.py writes such files";

impl Lpips {
    /// Reads the weights of a network and of LPIPS from a safetensors file. The module's documentation lists the names of
    /// tensors.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read. [`Error::Limit`] if it is larger than 1 GiB. [`Error::Format`] if it is
    /// not safetensors, or if a tensor is missing, is not F32, has the wrong shape, or holds NaN or infinity.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let io = |e| Error::io(path, e);
        let check = |found: u64| {
            if found <= MAX_BYTES {
                return Ok(());
            }
            let what = format!("bytes in {}", path.display());
            Err(Error::Limit { what, found, limit: MAX_BYTES })
        };
        let file = File::open(path).map_err(io)?;
        check(file.metadata().map_err(io)?.len())?;
        // Not every file knows its size, so the number of bytes read is checked too.
        let mut bytes = Vec::new();
        check(file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(io)? as u64)?;
        Self::from_bytes(&path.display().to_string(), &bytes)
    }

    /// Reads weights from a file in memory, as [`Self::load`] does. Errors call it `file`.
    ///
    /// # Errors
    /// [`Error::Format`] as for [`Self::load`].
    pub fn from_bytes(file: &str, bytes: &[u8]) -> Result<Self> {
        let malformed = |e| Error::format(file, format!("not a whole safetensors file: {e}; {ADVICE}"));
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(malformed)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(malformed)?;
        let named = header.metadata().as_ref().and_then(|metadata| metadata.get(NETWORK_KEY));
        let reader = Reader { file, tensors };
        let network = match named {
            Some(name) => Network::ALL.into_iter().find(|n| n.name() == name).ok_or_else(|| {
                reader.wrong(format!("metadata '{NETWORK_KEY}' is '{name}', not 'vgg' or 'alex'"))
            })?,
            None => reader.guess()?,
        };
        Self::build(network, |name, shape| reader.get(network, name, shape))
    }
}

struct Reader<'a> {
    file: &'a str,
    tensors: SafeTensors<'a>,
}

impl Reader<'_> {
    fn wrong(&self, problem: String) -> Error {
        Error::format(self.file, format!("{problem}; {ADVICE}"))
    }

    /// Returns the network whose first layer has these weights.
    fn guess(&self) -> Result<Network> {
        let missing = |e| self.wrong(format!("no metadata '{NETWORK_KEY}' and {e}"));
        let tensor = self.tensors.tensor(FIRST_TENSOR).map_err(missing)?;
        let first = |network: Network| network.stages()[0].convs[0].weight_shape();
        Network::ALL.into_iter().find(|&network| first(network) == tensor.shape()).ok_or_else(|| {
            let shape = tensor.shape();
            self.wrong(format!("tensor '{FIRST_TENSOR}' of shape {shape:?} is of neither VGG16 nor AlexNet"))
        })
    }

    fn get(&self, network: Network, name: &str, shape: &[usize]) -> Result<Vec<f32>> {
        let missing = |_| self.wrong(format!("tensor '{name}' of {network} is missing"));
        let tensor = self.tensors.tensor(name).map_err(missing)?;
        if tensor.dtype() != Dtype::F32 {
            return Err(self.wrong(format!("tensor '{name}' is {:?}, not F32", tensor.dtype())));
        }
        if tensor.shape() != shape {
            let found = tensor.shape();
            return Err(self.wrong(format!("tensor '{name}' has shape {found:?}, not {network}'s {shape:?}")));
        }
        let (values, _) = tensor.data().as_chunks();
        let values: Vec<f32> = values.iter().copied().map(f32::from_le_bytes).collect();
        match values.iter().position(|value| !value.is_finite()) {
            Some(at) => {
                let value = values[at];
                Err(self.wrong(format!("tensor '{name}' has {value} at entry {at}, not a finite number")))
            }
            None => Ok(values),
        }
    }
}

#[cfg(test)]
mod tests;
