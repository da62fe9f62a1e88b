//! Does quality level off as fewer and fewer coefficients are kept? In words, from the numbers.

use super::curve::{At, Kind, curve};
use super::grid::Grid;
use super::{Method, Results, Setting};

/// Steps shorter than this many doublings of the ratio have no slope worth telling.
const SHORTEST_STEP: f64 = 0.05;
/// The curve flattens where the last step is at most this steep, the first being 1.
const FLAT: f64 = 0.5;
/// The curve gets steeper where the last step is at least this steep, the first being 1.
const STEEP: f64 = 1.5;

/// One step along a curve.
struct Step {
    from: Setting,
    to: Setting,
    /// Change for each doubling of the ratio.
    slope: f64,
}

/// Steps between neighbours by ratio that are long enough to have a slope.
fn steps(curve: &[At], value: impl Fn(&At) -> Option<f64>) -> Vec<Step> {
    let mut points: Vec<(f64, f64, Setting)> = curve
        .iter()
        .filter_map(|at| Some((at.ratio.filter(|ratio| *ratio > 0.0)?.log2(), value(at)?, at.setting)))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
        .windows(2)
        .filter(|pair| pair[1].0 - pair[0].0 >= SHORTEST_STEP)
        .map(|pair| Step {
            from: pair[0].2,
            to: pair[1].2,
            slope: (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0),
        })
        .collect()
}

/// What the curve does, by its first and last slope.
fn verdict(first: f64, last: f64) -> &'static str {
    if last >= 0.0 || last.abs() <= FLAT * first.abs() {
        "the curve flattens"
    } else if last.abs() >= STEEP * first.abs() {
        "the curve gets steeper and does not level off"
    } else {
        "it keeps falling and does not level off"
    }
}

/// `costs 5.0 dB`, or `gains` where the slope is upwards.
fn cost(slope: f64) -> String {
    let word = if slope <= 0.0 { "costs" } else { "gains" };
    format!("{word} {:.1}\u{a0}dB", slope.abs())
}

/// One paragraph a method: what a doubling of the ratio costs in PSNR along tolerances and along capped
/// nonzeros, where PSNR is with at most one nonzero in every Gaussian and without SH, and what speed does
/// meanwhile. Plain text; methods with too few settings are left out.
#[must_use]
pub fn level_off(results: &Results) -> Vec<String> {
    let grid = Grid::new(results);
    grid.methods.iter().filter_map(|&method| paragraph(&grid, method)).collect()
}

fn paragraph(grid: &Grid<'_>, method: Method) -> Option<String> {
    let tolerances = curve(grid, method, Kind::Tolerances, None);
    let caps = curve(grid, method, Kind::Caps, None);
    let mut sentences = Vec::new();
    for (points, what) in [(&tolerances, "Along tolerances"), (&caps, "With capped nonzeros")] {
        let steps = steps(points, |at| at.psnr.mean);
        if let [first, .., last] = steps.as_slice() {
            sentences.push(format!(
                "{what} each doubling of the coefficient ratio {} at first ({} to {}) and {} at last ({} to {}): {}.",
                cost(first.slope),
                first.from.label(),
                first.to.label(),
                cost(last.slope),
                last.from.label(),
                last.to.label(),
                verdict(first.slope, last.slope)
            ));
        }
    }
    let at_cap = |most: u8| caps.iter().find(|at| at.setting == Setting::MaxNonzeros(most));
    if let Some(at) = at_cap(1)
        && let (Some(psnr), Some(ratio)) = (at.psnr.mean, at.ratio)
    {
        sentences.push(format!(
            "With at most one nonzero in every Gaussian (ratio {ratio:.1}) PSNR is {psnr:.2}\u{a0}dB."
        ));
    }
    if let Some(psnr) = at_cap(0).and_then(|at| at.psnr.mean) {
        sentences.push(format!("With SH dropped altogether it is {psnr:.2}\u{a0}dB, the floor."));
    }
    if sentences.is_empty() {
        return None;
    }
    sentences.extend(speed(grid, &tolerances));
    Some(format!("{}. {}", method.title(), sentences.join(" ")))
}

/// What FPS do from the first to the last setting that has them.
fn speed(grid: &Grid<'_>, points: &[At]) -> Option<String> {
    let timed: Vec<&At> = points.iter().filter(|at| at.fps.is_some() && at.ratio.is_some()).collect();
    let (first, last) = (timed.first()?, timed.last()?);
    let (from, to) = (first.fps?, last.fps?);
    if first.setting == last.setting || from <= 0.0 {
        return None;
    }
    let steps = steps(points, |at| at.fps);
    let share = |slope: f64| format!("{:+.1}\u{a0}%", slope / from * 100.0);
    let slopes = match steps.as_slice() {
        [first, .., last] => format!(
            "; a doubling of the ratio brings {} at first and {} at last",
            share(first.slope),
            share(last.slope)
        ),
        _ => String::new(),
    };
    let dense = first.fps_dense.map_or_else(String::new, |dense| format!(", {dense:.1} from dense SH"));
    Some(format!(
        "FPS on {} are {from:.1} at {} and {to:.1} at {}{dense}{slopes}.",
        grid.device(),
        first.setting.label(),
        last.setting.label()
    ))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{point, results, scene};
    use super::super::{Fps, Point};
    use super::*;

    /// One scene whose ratio doubles from setting to setting.
    fn falling(psnr: [f64; 4]) -> Results {
        let mut results = Results::default();
        let mut scene = scene("", "s", Method::Gs3d);
        for (k, psnr) in psnr.into_iter().enumerate() {
            let power = f64::from(u8::try_from(k).unwrap());
            scene.points.push(Point {
                fps: Some(Fps { dense: 10.0, sparse: 20.0 + power * power }),
                ..point(Setting::Tolerance(0.5 * (power + 1.0)), 16.0 / power.exp2(), Some(psnr))
            });
        }
        results.scenes.push(scene);
        results
    }

    #[test]
    fn slopes_by_hand() {
        let text = level_off(&falling([50.0, 44.0, 40.0, 38.0])).join("");
        assert_eq!(
            text.replace('\u{a0}', " "),
            "3DGS. Along tolerances each doubling of the coefficient ratio costs 6.0 dB at first (tol 0.5 to tol 1) and costs \
             2.0 dB at last (tol 1.5 to tol 2): the curve flattens. FPS on CPU are 20.0 at tol 0.5 and 29.0 at tol \
             2, 10.0 from dense SH; a doubling of the ratio brings +5.0 % at first and +25.0 % at last."
        );
        assert!(level_off(&falling([50.0, 44.0, 40.0, 35.0]))[0].contains("keeps falling"));
        assert!(level_off(&falling([50.0, 44.0, 40.0, 20.0]))[0].contains("steeper"));
        assert!(level_off(&falling([50.0, 44.0, 40.0, 41.0]))[0].contains("gains 1.0"));
    }

    #[test]
    fn caps_and_the_floor_are_told() {
        let text = level_off(&results());
        assert_eq!(text.len(), 1, "MCMC has one step only");
        assert!(text[0].contains("at most one nonzero in every Gaussian (ratio 50.0) PSNR is 29.00"));
        assert!(text[0].contains("dropped altogether it is 25.00"));
        assert!(level_off(&Results::default()).is_empty());
    }

    #[test]
    fn settings_of_one_ratio_have_no_slope() {
        let mut results = falling([50.0, 44.0, 40.0, 35.0]);
        for point in &mut results.scenes[0].points {
            point.coefficient_ratio = Some(4.0);
        }
        assert!(level_off(&results).is_empty());
    }
}
