//! Every PLY of the data folder, where there is one, reads and comes back with the same bits.

use std::path::PathBuf;

use lexisplat::ply;

/// `LEXISPLAT_DATA`, else `shared/data` beside the workspace; `None` if that is not there.
fn data_folder() -> Option<PathBuf> {
    let folder = std::env::var_os("LEXISPLAT_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    folder.is_dir().then_some(folder)
}

fn data_start(bytes: &[u8]) -> usize {
    let mark = b"end_header\n";
    bytes.windows(mark.len()).position(|w| w == mark).map_or(0, |at| at + mark.len())
}

#[test]
fn every_real_file_keeps_its_bits() {
    let Some(folder) = data_folder() else {
        eprintln!("no data folder: nothing to check");
        return;
    };
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "ply") {
            continue;
        }
        seen += 1;
        let original = std::fs::read(&path).unwrap();
        let read = ply::read(&path, &ply::ReadOptions::default()).unwrap();
        let mut written = Vec::new();
        let bytes = ply::write_to(&mut written, &read.splats).unwrap();
        assert_eq!(bytes, written.len() as u64);
        let again = ply::read_bytes("again", &written, &ply::ReadOptions::default()).unwrap();
        assert_eq!(again.splats, read.splats, "{}", path.display());

        if read.summary.dialect == ply::Dialect::Inria {
            // The writer's own layout: the rows are the same bytes, whatever follows them.
            let rows = &written[data_start(&written)..];
            let from = data_start(&original);
            assert!(rows == &original[from..from + rows.len()], "{}", path.display());
        }
        println!("{}: {:?} {} {:?}", path.display(), read.summary.dialect, read.splats.len(), read.warnings);
    }
    assert!(seen > 0, "the data folder holds no PLY");
}
