//! SPZ of all versions: any bytes are refused or give a scene that can be written and read again, within memory; whole and
//! a part at a time. The first byte says whether the others are the file, or what its gzip stream holds: no mutation
//! would have the right checksum.
#![no_main]

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use lexisplat_formats::Siblings;
use lexisplat_fuzz::{formats, one_thread};
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let Some((how, rest)) = data.split_first() else { return };
    if how % 2 == 0 {
        return formats::check("fuzz.spz", rest, &Siblings::NONE);
    }
    let mut gzip = GzEncoder::new(Vec::new(), Compression::none());
    gzip.write_all(rest).expect("memory can be written");
    let bytes = gzip.finish().expect("memory can be written");
    formats::check("fuzz.spz", &bytes, &Siblings::NONE);
});
