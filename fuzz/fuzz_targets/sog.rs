//! SOG: any bytes are refused or give a scene that can be written and read again, within memory; whole and a part at a
//! time. The first byte says whether the others are an archive, or `meta.json` and the pictures: no mutation of an archive
//! would have the right checksums.
#![no_main]

use lexisplat_formats::Siblings;
use lexisplat_fuzz::{formats, one_thread};
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: one_thread(), |data: &[u8]| {
    let Some((how, rest)) = data.split_first() else { return };
    if how % 2 == 0 {
        formats::check("fuzz.sog", rest, &Siblings::NONE);
    } else {
        formats::check_pieces("meta.json", rest);
    }
});
