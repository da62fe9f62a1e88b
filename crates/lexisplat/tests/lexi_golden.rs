//! Files written by released versions stay readable, and today's bytes are theirs.

use std::path::PathBuf;

use crate::common::{models, written};
use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::{Error, FormatError, Limits, Splats, lexi};
use lexisplat_testing::repository_file;

fn golden(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "golden", &format!("{name}.lexi")].iter().collect()
}

/// Makes the golden files of a new format version. Never run it to make a failing test pass.
#[test]
#[ignore = "writes tests/golden"]
fn regenerate() {
    for (name, codes, model) in models() {
        std::fs::write(golden(name), written(&model, codes)).unwrap();
    }
}

#[test]
fn golden_files_read_as_they_were_written() {
    for (name, _, model) in models() {
        let read = lexi::read(golden(name), &Limits::default()).unwrap();
        assert_eq!(read, model, "{name}");
    }
}

#[test]
fn todays_bytes_are_the_golden_ones() {
    for (name, codes, model) in models() {
        let bytes = written(&model, codes);
        assert!(bytes == std::fs::read(golden(name)).unwrap(), "{name} is written differently now");
        let writer = LexiWriter::exact(&model, codes).unwrap();
        assert_eq!(writer.file_bytes(), bytes.len() as u64, "{name}");
        let reader = LexiReader::open(name, bytes, &Limits::default()).unwrap();
        assert_eq!(writer.tensor_bytes(), reader.tensor_bytes(), "{name}");
    }
}

#[test]
fn other_readers_of_safetensors_take_them() {
    for (name, codes, model) in models() {
        let bytes = written(&model, codes);
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(tensors.tensor("position").unwrap().shape(), [5, 3], "{name}");
        assert_eq!(
            tensors.tensor("position").unwrap().data(),
            bytemuck::cast_slice::<_, u8>(&model.geometry().positions)
        );
        for (_, view) in tensors.iter() {
            let size = view.dtype().bitsize() / 8;
            let offset = view.data().as_ptr() as usize - bytes.as_ptr() as usize;
            assert!(offset.is_multiple_of(size), "{name}: a tensor is not aligned to its entries");
        }
    }
}

#[test]
fn a_dictionary_travels_alone() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _, model) in models() {
        let path = folder.path().join("d.lexi");
        if model.dictionary().is_empty() {
            assert!(matches!(
                lexi::write_dictionary(&path, model.dictionary()),
                Err(Error::Parameter { .. })
            ));
            assert!(lexi::read_dictionary(&golden(name), &Limits::default()).is_err());
            continue;
        }
        lexi::write_dictionary(&path, model.dictionary()).unwrap();
        assert_eq!(&lexi::read_dictionary(&path, &Limits::default()).unwrap(), model.dictionary(), "{name}");
        assert_eq!(&lexi::read_dictionary(&golden(name), &Limits::default()).unwrap(), model.dictionary());
        let error = lexi::read(&path, &Limits::default()).unwrap_err().to_string();
        assert!(error.contains("'lexi-dictionary'"), "{error}");
    }
}

#[test]
fn dense_values_are_the_sum_of_atoms() {
    for (name, _, model) in models() {
        let Splats { sh_rest, degree, .. } = model.clone().into_splats();
        let dim = degree.rest();
        let mut k = 0;
        for (i, &count) in model.codes().counts().iter().enumerate() {
            let mut expected = vec![0.0_f32; dim];
            if let Some(e) = model.codes().escapes().gaussians.iter().position(|&g| g as usize == i) {
                expected.copy_from_slice(&model.codes().escapes().rows[e * dim..][..dim]);
            }
            for _ in 0..count {
                let (atom, value) = (model.codes().indices().get(k), model.codes().values().get(k));
                for (e, a) in expected.iter_mut().zip(model.dictionary().atom(atom)) {
                    *e += value * a;
                }
                k += 1;
            }
            assert_eq!(&sh_rest[i * dim..][..dim], expected, "{name}, Gaussian {i}");
        }
    }
}

#[test]
fn newer_versions_are_refused_by_number() {
    let (_, codes, model) = models().swap_remove(1);
    let mut bytes = written(&model, codes);
    let text = b"\"version\":\"1\"";
    let at = bytes.windows(text.len()).position(|w| w == text).unwrap();
    bytes[at + text.len() - 2] = b'9';
    let error = lexi::read_bytes("future.lexi", &bytes, &Limits::default()).unwrap_err();
    assert!(
        matches!(
            error,
            Error::Format { problem: FormatError::Version { found: 9, supported: lexi::MAX_VERSION }, .. }
        ),
        "{error}"
    );
}

/// docs/FORMAT-EXAMPLES.md shows a file byte by byte; it must be this one.
#[test]
fn the_documented_example_is_true() {
    let Some(document) = repository_file("docs/FORMAT-EXAMPLES.md") else { return };
    let document = std::fs::read_to_string(document).unwrap();
    let has = |line: &str| {
        assert!(document.contains(&format!("{line}\n")), "docs/FORMAT-EXAMPLES.md lacks the line\n{line}");
    };
    // Of the packed file the header is shown as text.
    for (name, from) in [("degree0", 0), ("packed3_degree0", 0x120)] {
        let bytes = std::fs::read(golden(name)).unwrap();
        for (row, chunk) in bytes.chunks(16).enumerate().skip(from / 16) {
            let hex: Vec<String> = chunk.iter().map(|b| format!("{b:02x}")).collect();
            has(&format!("{:04x}  {}", row * 16, hex.join(" ")));
        }
        let length = u64::from_le_bytes(*bytes.first_chunk().unwrap());
        has(std::str::from_utf8(&bytes[8..8 + usize::try_from(length).unwrap()]).unwrap().trim_end());
    }
    let trace = std::fs::read_to_string(golden("packed3_degree0").with_extension("trace")).unwrap();
    trace.lines().filter(|line| line.starts_with("0 0 ")).for_each(has);
    let splats = lexi::read(golden("packed3_degree0"), &Limits::default()).unwrap().into_splats();
    let g = &splats.geometry;
    has(&format!("| opacity | {:.5} |", g.opacities[0]));
    has(&format!(
        "| dc | {} |",
        g.dc[0].map(|x| format!("{x:.6}").trim_end_matches('0').to_owned()).join(", ")
    ));
}
