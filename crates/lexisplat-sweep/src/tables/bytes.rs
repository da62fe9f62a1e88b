//! Real bytes: what every file takes on disk and while drawing.

use lexisplat::ShDegree;
use lexisplat::sh::CHANNELS;

use crate::grid::Grid;
use crate::measure::{DIGITS, Measure, quotient};
use crate::table::{Cell, Table};
use crate::{Point, Results, SceneResult};

/// Bytes of a value in a PLY, and in memory while drawing dense SH: f32.
const VALUE: u64 = 4;
/// Digits of residuals: tolerances have two, rounding shows in the sixth.
const RESIDUAL_DIGITS: usize = 6;
const CAPTION: &str = "Whole files, every byte counted; a ratio says how many times smaller. SH is view-dependent colour: its bytes in \
                       the file are dictionary, counts, indices, values and what is stored exactly, against f32 in the PLY. Resident \
                       is what colour takes in memory while drawing straight from the codes, base colour included, against dense f32.";

/// Bytes of all SH-rest values as f32, and of all SH values, base colour included.
fn dense(gaussians: u64, degree: u8) -> (u64, u64) {
    let rest = ShDegree::new(degree).map_or(0, |degree| degree.rest()) as u64;
    let each = |values: u64| gaussians.saturating_mul(values * VALUE);
    (each(rest), each(rest + CHANNELS as u64))
}

/// A file: that of a point, or else the one that a competitor ships.
struct File<'a> {
    heading: &'a str,
    scene: &'a SceneResult,
    point: Option<&'a Point>,
    bytes: u64,
}

/// Every scene at every setting: bytes of files, of view-dependent colour alone, and resident while drawing.
pub(crate) fn bytes(results: &Results) -> Table {
    let grid = Grid::new(results);
    let blocks = grid.scenes().map(|(heading, scene)| {
        let shipped = scene.shipped_bytes.map(|bytes| File { heading, scene, point: None, bytes });
        let points = scene.points.iter();
        let points = points.map(|point| File { heading, scene, point: Some(point), bytes: point.file_bytes });
        shipped.into_iter().chain(points).collect()
    });
    let ratio = |a: u64, b: u64| Cell::number(quotient(a as f64, b as f64), DIGITS);
    let of_point = |file: &File<'_>, cell: &dyn Fn(&Point) -> Cell| file.point.map_or(Cell::Missing, cell);
    let sh = |file: &File<'_>| dense(file.scene.gaussians, file.scene.sh_degree);
    let measure = |file: &File<'_>, measure: Measure| measure.cell(file.scene, file.point);
    Table::new("bytes", "Real bytes", CAPTION).with_records::<File<'_>>(
        3,
        &[
            ("", "Scene", &|file| Cell::text(file.heading)),
            ("", "Method", &|file| Cell::text(file.scene.method.title())),
            ("", "Setting", &|file| {
                Cell::text(file.point.map_or("as shipped".to_owned(), |p| p.setting.label()))
            }),
            ("", "Gaussians", &|file| Cell::Count(file.scene.gaussians)),
            ("Whole file", "PLY bytes", &|file| Cell::Count(file.scene.ply_bytes)),
            ("Whole file", "File bytes", &|file| Cell::Count(file.bytes)),
            ("Whole file", "Ratio", &|file| ratio(file.scene.ply_bytes, file.bytes)),
            ("Whole file", "Bytes a Gaussian", &|file| ratio(file.bytes, file.scene.gaussians)),
            ("SH in the file", "Bytes", &|file| of_point(file, &|p| Cell::Count(p.sh_bytes))),
            ("SH in the file", "Ratio", &|file| of_point(file, &|p| ratio(sh(file).0, p.sh_bytes))),
            ("SH resident", "Bytes", &|file| of_point(file, &|p| Cell::Count(p.resident_sh_bytes))),
            ("SH resident", "Ratio", &|file| of_point(file, &|p| ratio(sh(file).1, p.resident_sh_bytes))),
            ("Codes", "Atoms", &|file| of_point(file, &|p| Cell::Count(p.atoms as u64))),
            ("Codes", "Mean nonzeros", &|file| measure(file, Measure::MeanNonzeros)),
            ("Codes", "Comp Ratio (coefficients)", &|file| measure(file, Measure::CoefficientRatio)),
            ("Error", "Largest residual", &|file| {
                of_point(file, &|p| Cell::number(p.max_residual, RESIDUAL_DIGITS))
            }),
            ("Error", "Over tolerance", &|file| of_point(file, &|p| Cell::Count(p.over_tolerance))),
            ("", "Seconds", &|file| of_point(file, &|p| Cell::number(Some(p.seconds), 1))),
        ],
        blocks,
    )
}

#[cfg(test)]
mod tests {
    use super::super::testing::shown;
    use super::*;
    use crate::testing::results;

    #[test]
    fn bytes_by_hand() {
        let rows = shown(&bytes(&results()));
        let line = |method: &str, setting: &str| {
            rows.iter().find(|row| row[0] == "bonsai" && row[1] == method && row[2] == setting).unwrap()[3..]
                .join(" ")
        };
        // 1000 Gaussians of degree 3: 180,000 bytes of SH-rest, 192,000 with base colour.
        assert_eq!(
            line("3DGS", "tol 0.1"),
            "1,000 250,000 100,000 2.50 100.00 30,000 6.00 50,000 3.84 90 9.00 5.00 0.099000 0 1.5"
        );
        assert_eq!(
            line("3DGS", "nnz 4"),
            "1,000 250,000 100,000 2.50 100.00 30,000 6.00 50,000 3.84 90 4.00 11.25 2.500000 7 1.5"
        );
        assert!(line("3DGS", "small").starts_with("1,000 250,000 20,000 12.50 20.00 "));
        assert!(line("3DGS", "small").contains(" 15.00 \u{2013} 0 "), "no promise, no residual");
        assert!(line("EAGLES", "as shipped").starts_with("1,000 250,000 50,000 5.00 50.00 \u{2013} "));
        assert_eq!(rows.len(), 12 + 1);
    }

    #[test]
    fn unknown_degrees_and_empty_scenes_divide_by_nothing() {
        let mut results = results();
        for scene in &mut results.scenes {
            scene.sh_degree = 200;
            scene.gaussians = 0;
        }
        assert!(!bytes(&results).to_csv().contains("NaN"));
        assert_eq!(dense(1000, 3), (180_000, 192_000));
        assert_eq!(dense(10, 0), (0, 120));
    }
}
