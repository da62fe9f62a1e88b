//! The sections of a .ksplat: any bytes are refused or give a scene that can be written and read again, within memory; whole and a
//! part at a time.
#![no_main]

use lexisplat_formats::Siblings;
use lexisplat_fuzz::{formats, one_thread};
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: one_thread(), |data: &[u8]| formats::check("fuzz.ksplat", data, &Siblings::NONE));
