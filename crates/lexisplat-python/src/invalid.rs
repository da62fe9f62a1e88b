//! NaN and infinite values in scenes from Python. They cause an error that names the array, or their Gaussians are left
//! out.

use lexisplat::Splats;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::errors::parameter;

/// Number of values that one task examines.
const PER_TASK: usize = 1 << 16;

/// Returns `splats` without Gaussians whose values are not finite, and a message about them.
///
/// Extra properties may have any values, as in files.
pub(crate) fn finite(
    py: Python<'_>,
    mut splats: Splats,
    drop_invalid: bool,
) -> PyResult<(Splats, Option<String>)> {
    if py.detach(|| arrays(&splats).into_iter().all(|(_, _, values)| all_finite(values))) {
        return Ok((splats, None));
    }
    let keep = keep(&splats);
    let (all, bad) = (keep.len(), keep.iter().filter(|kept| !**kept).count());
    let first = keep.iter().position(|kept| !kept).unwrap_or_default();
    let (name, value) = bad_value(&splats, first);
    if !drop_invalid {
        let expected = format!(
            "finite values; {bad} of {all} Gaussians hold NaN or infinite values, and drop_invalid=True leaves such Gaussians \
             out"
        );
        return Err(parameter(py, name, format!("{value} of Gaussian {first}"), expected));
    }
    if bad == all {
        let expected = "a Gaussian without NaN and infinite values: with drop_invalid=True none is left";
        return Err(parameter(py, name, format!("{value} of Gaussian {first}"), expected));
    }
    splats.retain(&keep);
    let told = format!(
        "dropped {bad} of {all} Gaussians with NaN or infinite values, the first is number {first} ({name})"
    );
    Ok((splats, Some(told)))
}

/// Returns the arrays with their names in Python and the number of values of a Gaussian.
fn arrays(splats: &Splats) -> [(&'static str, usize, &[f32]); 7] {
    let g = &splats.geometry;
    [
        ("means", 3, g.positions.as_flattened()),
        ("scales", 3, g.scales.as_flattened()),
        ("quats", 4, g.rotations.as_flattened()),
        ("opacities", 1, &g.opacities),
        ("sh0", 3, g.dc.as_flattened()),
        ("shN", splats.degree.rest(), &splats.sh_rest),
        ("normals", 3, g.normals.as_flattened()),
    ]
}

fn all_finite(values: &[f32]) -> bool {
    // The inner loop has no early exit, so that it is vectorised.
    values.par_chunks(PER_TASK).all(|values| values.iter().fold(true, |good, v| good & v.is_finite()))
}

/// Returns for each Gaussian whether all its values are finite.
fn keep(splats: &Splats) -> Vec<bool> {
    let mut keep = vec![true; splats.len()];
    for (_, each, values) in arrays(splats) {
        for (keep, values) in keep.iter_mut().zip(values.chunks_exact(each.max(1))) {
            *keep &= values.iter().all(|v| v.is_finite());
        }
    }
    keep
}

/// Returns the first value of Gaussian `i` that is not finite, and the name of its array.
fn bad_value(splats: &Splats, i: usize) -> (&'static str, f32) {
    let found = arrays(splats).into_iter().find_map(|(name, each, values)| {
        let own = values.get(i * each..(i + 1) * each)?;
        own.iter().find(|v| !v.is_finite()).map(|value| (name, *value))
    });
    found.unwrap_or(("means", f32::NAN))
}
