//! `meta.json` of a SOG.

use lexisplat::{Error, FormatError, Result, ShDegree};
use serde::Deserialize;

use super::code::{LEVELS, lerp, position};
use crate::opacity::{MOST, logits};

/// Version that is written. A file without a version has version 1.
pub(super) const VERSION: u64 = 2;
/// Largest number of bands, which is the SH degree.
const MOST_BANDS: u64 = 3;

/// The values of the 256 codes of 8 bits.
pub(super) type Table = [f32; LEVELS];

#[derive(Debug, Deserialize)]
struct Raw {
    version: Option<u64>,
    count: Option<u64>,
    #[serde(default)]
    antialias: Option<bool>,
    #[serde(default)]
    asset: Option<RawAsset>,
    means: RawMeans,
    scales: RawValues,
    quats: RawFiles,
    sh0: RawValues,
    #[serde(rename = "shN", default)]
    sh_n: Option<RawSh>,
}

#[derive(Debug, Deserialize)]
struct RawAsset {
    generator: Option<String>,
}

#[derive(Debug, Deserialize)]
struct RawMeans {
    /// Only in version 1.
    shape: Option<Vec<u64>>,
    mins: Vec<f64>,
    maxs: Vec<f64>,
    files: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct RawFiles {
    files: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct RawValues {
    codebook: Option<Vec<Option<f64>>>,
    /// Only in version 1.
    mins: Option<Vec<f64>>,
    maxs: Option<Vec<f64>>,
    files: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct RawSh {
    count: Option<u64>,
    bands: Option<u64>,
    codebook: Option<Vec<Option<f64>>>,
    /// Only in version 1.
    mins: Option<f64>,
    maxs: Option<f64>,
    files: Vec<String>,
}

/// The contents of `meta.json`.
#[derive(Debug)]
pub(super) struct Meta {
    pub(super) version: u64,
    pub(super) count: u64,
    pub(super) antialiased: bool,
    pub(super) generator: Option<String>,
    /// Ends of the range of positions along each axis, as logarithms.
    pub(super) ends: [[f64; 2]; 3],
    /// Values of the scales along each axis.
    pub(super) scales: [Table; 3],
    /// Values of each colour channel.
    pub(super) colours: [Table; 3],
    pub(super) opacities: Table,
    pub(super) means_files: [String; 2],
    pub(super) scales_file: String,
    pub(super) quats_file: String,
    pub(super) sh0_file: String,
    pub(super) sh: Option<ShMeta>,
    pub(super) warnings: Vec<String>,
}

/// The statements of `meta.json` about SH.
#[derive(Debug)]
pub(super) struct ShMeta {
    /// SH degree and number of entries of the palette. In version 1 they follow from the picture, and this is `None`.
    pub(super) palette: Option<(ShDegree, usize)>,
    pub(super) values: Table,
    /// Files of the palette, and of each Gaussian's entry.
    pub(super) files: [String; 2],
}

impl Meta {
    /// Parses `bytes` of the file `name`.
    pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<Self> {
        let malformed = |text: String| Error::malformed(name, format!("meta.json: {text}"));
        let raw: Raw = serde_json::from_slice(bytes).map_err(|error| malformed(error.to_string()))?;
        let version = raw.version.unwrap_or(1);
        if version > VERSION {
            return Err(Error::format(name, FormatError::Version { found: version, supported: VERSION }));
        }
        let shape = raw.means.shape.as_ref().and_then(|shape| shape.first()).copied();
        let count = if version < VERSION { shape } else { raw.count };
        let count = count.ok_or_else(|| malformed("the number of Gaussians is missing".to_owned()))?;
        let mut warnings = Vec::new();
        let mut reader = Reader { name, version, warnings: &mut warnings };
        let low = reader.numbers::<3>("means.mins", Some(&raw.means.mins))?;
        let high = reader.numbers::<3>("means.maxs", Some(&raw.means.maxs))?;
        let ends = [0, 1, 2].map(|k| [low[k], high[k]]);
        let far = |ends: &[f64; 2]| [0, u16::MAX].iter().any(|&code| !position(code, *ends).is_finite());
        if ends.iter().any(far) {
            return Err(malformed(format!("positions between {low:?} and {high:?} are not finite")));
        }
        let [scales, colours, opacities] = reader.values(&raw.scales, &raw.sh0)?;
        let sh = raw.sh_n.map(|sh| reader.sh(sh)).transpose()?;
        Ok(Self {
            version,
            count,
            antialiased: raw.antialias.unwrap_or(false),
            generator: raw.asset.and_then(|asset| asset.generator),
            ends,
            scales,
            colours,
            opacities: opacities[0],
            means_files: reader.files("means", raw.means.files)?,
            scales_file: first(reader.files("scales", raw.scales.files)?),
            quats_file: first(reader.files("quats", raw.quats.files)?),
            sh0_file: first(reader.files("sh0", raw.sh0.files)?),
            sh,
            warnings,
        })
    }
}

fn first([name]: [String; 1]) -> String {
    name
}

/// Checks the values of a file.
struct Reader<'a> {
    name: &'a str,
    version: u64,
    warnings: &'a mut Vec<String>,
}

impl Reader<'_> {
    fn malformed(&self, text: &str) -> Error {
        Error::malformed(self.name, format!("meta.json: {text}"))
    }

    /// Returns the `N` finite numbers of the property `what`.
    fn numbers<const N: usize>(&self, what: &str, values: Option<&Vec<f64>>) -> Result<[f64; N]> {
        let values = values.ok_or_else(|| self.malformed(&format!("'{what}' is missing")))?;
        let found = values.first_chunk::<N>().filter(|_| values.len() == N);
        let found =
            found.ok_or_else(|| self.malformed(&format!("'{what}' has {} values, not {N}", values.len())))?;
        self.finite(what, found)?;
        Ok(*found)
    }

    /// Returns an error if a value is out of the range of single precision.
    fn finite(&self, what: &str, values: &[f64]) -> Result<()> {
        match values.iter().find(|v| v.abs() > f64::from(f32::MAX)) {
            Some(value) => Err(self.malformed(&format!("'{what}' has {value}, which is out of range"))),
            None => Ok(()),
        }
    }

    /// Returns the values of scales, colours and opacities.
    fn values(&mut self, scales: &RawValues, sh0: &RawValues) -> Result<[[Table; 3]; 3]> {
        if self.version < VERSION {
            let [low, high] = [&scales.mins, &scales.maxs].map(Option::as_ref);
            let low: [f64; 3] = self.numbers("scales.mins", low)?;
            let high: [f64; 3] = self.numbers("scales.maxs", high)?;
            let [least, most] = [&sh0.mins, &sh0.maxs].map(Option::as_ref);
            let least: [f64; 4] = self.numbers("sh0.mins", least)?;
            let most: [f64; 4] = self.numbers("sh0.maxs", most)?;
            return Ok([
                [0, 1, 2].map(|k| table(low[k], high[k])),
                [0, 1, 2].map(|k| table(least[k], most[k])),
                [table(least[3], most[3]); 3],
            ]);
        }
        let scales = self.codebook("scales.codebook", scales.codebook.as_deref())?;
        let colours = self.codebook("sh0.codebook", sh0.codebook.as_deref())?;
        Ok([[scales; 3], [colours; 3], [logits(); 3]])
    }

    /// Returns a list of 256 values.
    #[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
    fn codebook(&mut self, what: &str, values: Option<&[Option<f64>]>) -> Result<Table> {
        let values = values.ok_or_else(|| self.malformed(&format!("'{what}' is missing")))?;
        if values.len() != LEVELS {
            let found = values.len();
            return Err(self.malformed(&format!("'{what}' has {found} values, not {LEVELS}")));
        }
        let mut numbers: Vec<f64> = values.iter().map(|v| v.unwrap_or_default()).collect();
        match values.iter().position(Option::is_none) {
            None => {}
            // Files of an early splat-transform. The engine of `PlayCanvas` assumes the same value (`_patchCodebooks`).
            Some(0) if values.iter().skip(1).all(Option::is_some) => {
                self.warnings.push(format!("the first value of {what} is missing, and is continued"));
                numbers[0] = numbers[1] + (numbers[1] - numbers[LEVELS - 1]) / f64::from(MOST);
            }
            Some(at) => return Err(self.malformed(&format!("value {at} of '{what}' is missing"))),
        }
        self.finite(what, &numbers)?;
        Ok(std::array::from_fn(|k| numbers[k] as f32))
    }

    fn sh(&mut self, sh: RawSh) -> Result<ShMeta> {
        let files = self.files("shN", sh.files)?;
        if self.version < VERSION {
            let [low]: [f64; 1] = self.numbers("shN.mins", sh.mins.map(|v| vec![v]).as_ref())?;
            let [high]: [f64; 1] = self.numbers("shN.maxs", sh.maxs.map(|v| vec![v]).as_ref())?;
            return Ok(ShMeta { palette: None, values: table(low, high), files });
        }
        let bands = sh.bands.unwrap_or_default();
        let degree = u8::try_from(bands.min(MOST_BANDS + 1)).unwrap_or_default();
        if bands == 0 || bands > MOST_BANDS {
            return Err(self.malformed(&format!("'shN.bands' is {bands}, not 1 to {MOST_BANDS}")));
        }
        let entries = sh.count.and_then(|count| usize::try_from(count).ok());
        let entries = entries.ok_or_else(|| self.malformed("'shN.count' is missing"))?;
        let values = self.codebook("shN.codebook", sh.codebook.as_deref())?;
        Ok(ShMeta { palette: Some((ShDegree::new(degree)?, entries)), values, files })
    }

    /// Returns the names of `N` files.
    fn files<const N: usize>(&self, what: &str, files: Vec<String>) -> Result<[String; N]> {
        let found = files.len();
        files.try_into().map_err(|_| self.malformed(&format!("'{what}.files' has {found} names, not {N}")))
    }
}

/// Returns 256 values in equal steps from `low` to `high`.
#[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
fn table(low: f64, high: f64) -> Table {
    std::array::from_fn(|k| lerp(low, high, k as f64 / f64::from(MOST)) as f32)
}
