//! Weight files, whole and damaged.

use std::collections::HashMap;

use safetensors::tensor::TensorView;

use super::*;
use crate::metrics::lpips::PixelRange;
use crate::metrics::lpips::testing::{random, tensors};
use crate::metrics::testing::picture;

type Tensors = Vec<(String, Vec<usize>, Vec<f32>)>;

fn file(tensors: &Tensors, network: Option<&str>) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> =
        tensors.iter().map(|t| t.2.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    let views = tensors.iter().zip(&bytes).map(|((name, shape, _), bytes)| {
        (name.clone(), TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap())
    });
    let metadata = network.map(|name| HashMap::from([(NETWORK_KEY.to_owned(), name.to_owned())]));
    safetensors::serialize(views, metadata).unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    let error = Lpips::from_bytes("weights", bytes).unwrap_err();
    assert!(matches!(error, Error::Format { .. }), "{error}");
    error.to_string()
}

/// Asserts that the file is refused in these words once `damage` is done.
fn refused(damage: impl FnOnce(&mut Tensors), words: &[&str]) {
    let mut tensors = tensors(Network::Alex, 1);
    damage(&mut tensors);
    let error = refusal(&file(&tensors, Some("alex")));
    for word in words {
        assert!(error.contains(word), "'{word}' is not in: {error}");
    }
}

#[test]
fn a_file_gives_the_network_it_holds() {
    let (a, b) = (picture(40, 40, 1), picture(40, 40, 2));
    let mut tensors = tensors(Network::Alex, 7);
    // Layers for classification may be there.
    tensors.push(("classifier.1.weight".to_owned(), vec![2], vec![f32::NAN; 2]));
    let expected = random(Network::Alex, 7).distance(&a, &b, PixelRange::Standard).unwrap();
    for named in [Some("alex"), None] {
        let lpips = Lpips::from_bytes("weights", &file(&tensors, named)).unwrap();
        assert_eq!(lpips.network(), Network::Alex);
        assert_eq!(lpips.distance(&a, &b, PixelRange::Standard).unwrap().to_bits(), expected.to_bits());
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    std::fs::write(&path, file(&tensors, None)).unwrap();
    assert_eq!(Lpips::load(&path).unwrap().network(), Network::Alex);
}

#[test]
fn vgg_is_told_by_its_first_layer() {
    let first = tensors(Network::Vgg, 1).into_iter().take(1).collect();
    let error = refusal(&file(&first, None));
    assert!(error.contains("'features.0.bias' of VGG16 is missing"), "{error}");
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = Lpips::load(folder.path().join("nothing")).unwrap_err();
    assert!(matches!(&error, Error::Io { file, .. } if file.ends_with("nothing")), "{error}");
    let path = folder.path().join("large");
    File::create(&path).unwrap().set_len(MAX_BYTES + 1).unwrap();
    let error = Lpips::load(path).unwrap_err();
    assert!(matches!(error, Error::Limit { found, limit: MAX_BYTES, .. } if found > MAX_BYTES), "{error}");
}

#[test]
fn wrong_tensors_are_refused_by_name() {
    refused(|t| drop(t.remove(5)), &["weights: ", "'features.6.bias'", "AlexNet", "missing", "scripts/"]);
    refused(|t| drop(t.pop()), &["'lin4.model.1.weight'", "missing"]);
    refused(|t| t[2].1 = vec![64, 192, 5, 5], &["'features.3.weight'", "[64, 192, 5, 5]", "[192, 64, 5, 5]"]);
    refused(|t| t[1].1 = vec![8, 8], &["'features.0.bias'", "[8, 8]", "[64]"]);
    refused(|t| t[4].2[77] = f32::NAN, &["'features.6.weight'", "NaN", "entry 77"]);
    refused(|t| t[11].2[3] = f32::NEG_INFINITY, &["'lin1.model.1.weight'", "-inf", "entry 3"]);
}

#[test]
fn other_types_and_networks_are_refused() {
    let half = [0; 64 * 3 * 11 * 11 * 2];
    let view = TensorView::new(Dtype::F16, vec![64, 3, 11, 11], &half).unwrap();
    let bytes = safetensors::serialize([(FIRST_TENSOR, view)], None).unwrap();
    assert!(refusal(&bytes).contains("'features.0.weight' is F16, not F32"));

    let tensors = tensors(Network::Alex, 1);
    assert!(refusal(&file(&tensors, Some("squeeze"))).contains("'network' is 'squeeze'"));
    assert!(refusal(&file(&tensors, Some("vgg"))).contains("not VGG16's [64, 3, 3, 3]"));
    let odd: Tensors = vec![(FIRST_TENSOR.to_owned(), vec![1, 1], vec![0.0])];
    assert!(refusal(&file(&odd, None)).contains("[1, 1] is of neither"));
    assert!(refusal(&file(&Vec::new(), None)).contains("no metadata 'network'"));
}

#[test]
fn every_cut_is_refused() {
    let whole = file(&tensors(Network::Alex, 1), Some("alex"));
    let header = usize::try_from(u64::from_le_bytes(*whole.first_chunk().unwrap())).unwrap() + 8;
    for length in
        (0..header + 20).chain((header..whole.len()).step_by(whole.len() / 50)).chain([whole.len() - 1])
    {
        refusal(&whole[..length]);
    }
    let mut longer = whole;
    longer.push(0);
    refusal(&longer);
}

#[test]
fn no_changed_header_is_more_than_refused() {
    let mut whole = file(&tensors(Network::Alex, 1), Some("alex"));
    let header = usize::try_from(u64::from_le_bytes(*whole.first_chunk().unwrap())).unwrap() + 8;
    let mut read = 0;
    for at in 0..header {
        for change in [1, 0x80] {
            // Some changes make another file that holds, as of white space; what matters is that none panics.
            whole[at] ^= change;
            read += usize::from(Lpips::from_bytes("weights", &whole).is_ok());
            whole[at] ^= change;
        }
    }
    assert!(read < header / 4, "{read} of {header}");
}
