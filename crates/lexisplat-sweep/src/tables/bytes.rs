//! Real bytes: what every file takes, on disk and while drawing.

use lexisplat::ShDegree;
use lexisplat::sh::CHANNELS;

use super::{row, ruled};
use crate::Results;
use crate::grid::{Grid, quotient};
use crate::table::{Cell, Table};

/// Bytes of a value in a PLY and in memory while drawing dense SH: f32.
const VALUE: u64 = 4;
/// Digits of ratios.
const DIGITS: usize = 2;
/// Digits of residuals: tolerances have two, rounding shows in the sixth.
const RESIDUAL_DIGITS: usize = 6;

/// Bytes of all SH-rest values as f32, and of all SH values, base colour included.
fn dense(gaussians: u64, degree: u8) -> (u64, u64) {
    let rest = ShDegree::new(degree).map_or(0, |degree| degree.rest()) as u64;
    let each = |values: u64| gaussians.saturating_mul(values * VALUE);
    (each(rest), each(rest + CHANNELS as u64))
}

/// Every scene in every setting: bytes of files, of view-dependent colour alone, and resident while drawing.
#[must_use]
pub fn bytes(results: &Results) -> Table {
    let grid = Grid::new(results);
    let mut rows = Vec::new();
    for (heading, scene) in grid.scenes() {
        let (sh_rest, sh) = dense(scene.gaussians, scene.sh_degree);
        let names = |setting: String| [heading.to_owned(), scene.method.title().to_owned(), setting];
        let over = |a: u64, b: u64| Cell::number(quotient(a as f64, b as f64), DIGITS);
        let mut of_scene = Vec::new();
        if let Some(shipped) = scene.shipped_bytes {
            let mut cells = vec![
                Cell::Count(scene.gaussians),
                Cell::Count(scene.ply_bytes),
                Cell::Count(shipped),
                over(scene.ply_bytes, shipped),
                over(shipped, scene.gaussians),
            ];
            cells.resize(HEADER.len() - names(String::new()).len(), Cell::Missing);
            of_scene.push(row(names("as shipped".to_owned()), cells));
        }
        for point in &scene.points {
            of_scene.push(row(
                names(point.setting.label()),
                [
                    Cell::Count(scene.gaussians),
                    Cell::Count(scene.ply_bytes),
                    Cell::Count(point.file_bytes),
                    over(scene.ply_bytes, point.file_bytes),
                    over(point.file_bytes, scene.gaussians),
                    Cell::Count(point.sh_bytes),
                    over(sh_rest, point.sh_bytes),
                    Cell::Count(point.resident_sh_bytes),
                    over(sh, point.resident_sh_bytes),
                    Cell::Count(point.atoms as u64),
                    Cell::number(Some(point.mean_nonzeros), DIGITS),
                    Cell::number(point.coefficient_ratio, DIGITS),
                    Cell::number(point.max_residual, RESIDUAL_DIGITS),
                    Cell::Count(point.over_tolerance),
                    Cell::number(Some(point.seconds), 1),
                ],
            ));
        }
        rows.extend(ruled(of_scene));
    }
    Table {
        name: "bytes",
        title: "Real bytes".to_owned(),
        caption: "Whole files, every byte counted; a ratio says how many times smaller. SH is view-dependent colour: its bytes in the file \
                  are dictionary, counts, indices, values and what is stored exactly, against f32 in the PLY. Resident is what \
                  colour takes in memory while drawing straight from the codes, base colour included, against dense f32."
            .to_owned(),
        groups: vec![
            (String::new(), 4),
            ("Whole file".to_owned(), 4),
            ("SH in the file".to_owned(), 2),
            ("SH resident".to_owned(), 2),
            ("Codes".to_owned(), 3),
            ("Error".to_owned(), 2),
            (String::new(), 1),
        ],
        header: HEADER.map(str::to_owned).into(),
        labels: 3,
        rows,
    }
}

const HEADER: [&str; 18] = [
    "Scene",
    "Method",
    "Setting",
    "Gaussians",
    "PLY bytes",
    "File bytes",
    "Ratio",
    "Bytes a Gaussian",
    "Bytes",
    "Ratio",
    "Bytes",
    "Ratio",
    "Atoms",
    "Mean nonzeros",
    "Comp Ratio (coefficients)",
    "Largest residual",
    "Over tolerance",
    "Seconds",
];

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
