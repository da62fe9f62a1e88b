//! Every PLY of the data folder, where there is one, reads and comes back with the same bits.

use lexisplat::ply;
use lexisplat_testing::real_data_folder;

fn data_start(bytes: &[u8]) -> usize {
    let mark = b"end_header\n";
    bytes.windows(mark.len()).position(|w| w == mark).map_or(0, |at| at + mark.len())
}

#[test]
fn every_real_file_keeps_its_bits() {
    let Some(folder) = real_data_folder() else { return };
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
        let bytes = ply::write(&mut written, &read.splats).unwrap();
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
