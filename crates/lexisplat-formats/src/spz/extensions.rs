//! Records of extensions: a type, a length, and as many bytes as the length (nianticlabs/spz, `extensions/README.md`).

use lexisplat::{Error, Result};

use crate::axes::Flip;
use crate::numbers::u32_at;

/// Number of bytes of a record's type and length.
const HEAD: usize = 8;
/// Type of the record that names the axes (`SPZ_ADOBE_coordinate_system`, `coordinate-system-adobe.h`).
const COORDINATES: u32 = 0xADBE_0003;
/// Numbers of coordinate systems: 1 to 8 of `CoordinateSystem` in `splat-types.h`. They differ from the axes of a PLY
/// (right, down, front). In the number less 1, bit 0 is right, bit 1 is up, and bit 2 is front.
const AXES: std::ops::RangeInclusive<u32> = 1..=8;

/// The contents of the records.
#[derive(Debug, PartialEq)]
pub(super) struct Extensions {
    pub(super) flip: Flip,
    /// Number of records.
    pub(super) count: usize,
    pub(super) warnings: Vec<String>,
}

impl Default for Extensions {
    fn default() -> Self {
        Self { flip: Flip::HALF_TURN, count: 0, warnings: Vec::new() }
    }
}

impl Extensions {
    /// Reads the records in `bytes` of the file called `name`.
    pub(super) fn read(name: &str, mut bytes: &[u8]) -> Result<Self> {
        let mut found = Self::default();
        while bytes.len() >= HEAD {
            let (kind, length) = (u32_at(bytes, 0), u32_at(bytes, 4) as usize);
            let Some(payload) = bytes.get(HEAD..).and_then(|rest| rest.get(..length)) else {
                let text = format!(
                    "extension {kind:#010x} claims {length} bytes, and {} are left",
                    bytes.len() - HEAD
                );
                return Err(Error::malformed(name, text));
            };
            bytes = &bytes[HEAD + length..];
            found.count += 1;
            let axes = u32_at(payload, 0);
            match kind {
                // 0 means that the axes are not specified.
                COORDINATES if length >= 4 && axes == 0 => {}
                COORDINATES if length >= 4 && AXES.contains(&axes) => {
                    let [right, up, front] = [0, 1, 2].map(|bit| (axes - 1) >> bit & 1 == 1);
                    found.flip = Flip::of([!right, up, !front]);
                }
                COORDINATES => {
                    return Err(Error::malformed(
                        name,
                        format!("axes number {axes}, whose y and z are swapped, are not read"),
                    ));
                }
                _ => {
                    let text = format!("extension {kind:#010x} of {length} bytes is not known, and left out");
                    found.warnings.push(text);
                }
            }
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(kind: u32, payload: &[u8]) -> Vec<u8> {
        let length = u32::try_from(payload.len()).unwrap();
        [&kind.to_le_bytes(), &length.to_le_bytes(), payload].concat()
    }

    #[test]
    fn axes_are_taken_and_others_are_named() {
        let axes = |number: u32| Extensions::read("a", &record(COORDINATES, &number.to_le_bytes()));
        // RUB is the default, RDF that of a PLY, LUF mirrors nothing.
        assert_eq!(axes(4).unwrap().flip, Flip::HALF_TURN);
        assert_eq!(axes(6).unwrap().flip, Flip::of([false; 3]));
        assert_eq!(axes(7).unwrap().flip, Flip::of([true, true, false]));
        assert!(axes(9).unwrap_err().to_string().contains("axes number 9"));
        let two = [record(0x1234_0001, &[0; 5]), record(COORDINATES, &6_u32.to_le_bytes())].concat();
        let found = Extensions::read("a", &two).unwrap();
        assert_eq!((found.count, found.flip, found.warnings.len()), (2, Flip::of([false; 3]), 1));
        assert_eq!(Extensions::read("a", &[]).unwrap(), Extensions::default());
    }

    #[test]
    fn records_longer_than_the_file_are_refused() {
        let mut long = record(1, &[0; 5]);
        long[4] = 6;
        assert!(
            Extensions::read("a", &long).unwrap_err().to_string().contains("claims 6 bytes, and 5 are left")
        );
    }
}
