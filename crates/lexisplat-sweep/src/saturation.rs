//! Whether quality stops falling as fewer and fewer coefficients are kept, in words made from the numbers.

use super::curve::{At, Kind, curve, dense_noise};
use super::grid::Grid;
use super::measure::Measure;
use super::table::signed;
use super::{Method, Results, Setting};

/// Shortest step along a curve that has a slope, in doublings of the ratio.
const SHORTEST_STEP: f64 = 0.05;
/// The curve flattens if the last step is at most this steep, relative to the first.
const FLAT: f64 = 0.5;
/// The curve gets steeper if the last step is at least this steep, relative to the first.
const STEEP: f64 = 1.5;

/// One step along a curve.
struct Step {
    from: Setting,
    to: Setting,
    /// Change of the value for each doubling of the ratio.
    slope: f64,
    /// Change of the value.
    change: f64,
}

/// The steps between neighbours by ratio that are long enough to have a slope.
fn steps(curve: &[At<'_>], value: impl Fn(&At<'_>) -> Option<f64>) -> Vec<Step> {
    let point = |at: &At<'_>| Some((at.ratio().filter(|ratio| *ratio > 0.0)?.log2(), value(at)?, at.setting));
    let mut points: Vec<(f64, f64, Setting)> = curve.iter().filter_map(point).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let long = points.windows(2).filter(|pair| pair[1].0 - pair[0].0 >= SHORTEST_STEP);
    long.map(|pair| Step {
        from: pair[0].2,
        to: pair[1].2,
        slope: (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0),
        change: pair[1].1 - pair[0].1,
    })
    .collect()
}

/// Describes the curve by its first and last slope.
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

/// One paragraph for each method: what a doubling of the ratio costs in PSNR along tolerances and along capped
/// nonzeros, the PSNR with at most one nonzero in every Gaussian and without SH, and how speed changes. Plain
/// text. Methods with too few settings are left out.
pub(crate) fn saturation(results: &Results) -> Vec<String> {
    let grid = Grid::new(results);
    grid.methods.iter().filter_map(|&method| paragraph(&grid, method)).collect()
}

fn paragraph(grid: &Grid<'_>, method: Method) -> Option<String> {
    let tolerances = curve(grid, method, Kind::Tolerances, None);
    let caps = curve(grid, method, Kind::Caps, None);
    let mut sentences = Vec::new();
    for (points, what) in [(&tolerances, "Along tolerances"), (&caps, "With capped nonzeros")] {
        if let [first, .., last] = steps(points, |at| at.psnr().mean).as_slice() {
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
    if let Some((psnr, ratio)) = at_cap(1).and_then(|at| at.psnr().mean.zip(at.ratio())) {
        sentences.push(format!(
            "With at most one nonzero in every Gaussian (ratio {ratio:.1}) PSNR is {psnr:.2}\u{a0}dB."
        ));
    }
    if let Some(psnr) = at_cap(0).and_then(|at| at.psnr().mean) {
        sentences.push(format!("With SH dropped altogether it is {psnr:.2}\u{a0}dB, the floor."));
    }
    if sentences.is_empty() {
        return None;
    }
    sentences.extend(speed(grid, &tolerances));
    Some(format!("{}. {}", method.title(), sentences.join(" ")))
}

/// How FPS change from the first to the last setting that has them. Of differences within what the same drawing of dense SH
/// varies by nothing is said but that.
fn speed(grid: &Grid<'_>, points: &[At<'_>]) -> Option<String> {
    let fps = |at: &At<'_>| at.mean(Measure::SparseFps);
    let mut timed = points.iter().filter(|at| at.ratio().is_some() && fps(at).is_some());
    let (first, last) = (timed.next()?, timed.next_back()?);
    let (from, to) = (fps(first)?, fps(last)?);
    if from <= 0.0 {
        return None;
    }
    let percent = |share: f64| format!("{}\u{a0}%", signed(share * 100.0, 1));
    let share = |slope: f64| percent(slope / from);
    let noise = dense_noise(points).unwrap_or(f64::INFINITY);
    let is_told = |change: f64| change.abs() > noise * from;
    let slopes = match steps(points, fps).as_slice() {
        _ if !is_told(to - from) => format!(
            "; they differ by less than the {:.1}\u{a0}% that drawing the same dense SH varies by, so no trend can be told",
            noise * 100.0
        ),
        [first, .., last] if is_told(first.change) && is_told(last.change) => format!(
            "; a doubling of the ratio brings {} at first and {} at last",
            share(first.slope),
            share(last.slope)
        ),
        _ => String::new(),
    };
    let dense = first.mean(Measure::DenseFps);
    let dense = dense.map_or_else(String::new, |dense| format!(", {dense:.1} from dense SH"));
    Some(format!(
        "FPS on {} are {from:.1} at {} and {to:.1} at {}{dense}{slopes}.",
        grid.device(),
        first.setting.label(),
        last.setting.label()
    ))
}

#[cfg(test)]
mod tests {
    use super::super::Point;
    use super::super::testing::{fps, point, results, scene};
    use super::*;

    /// One scene whose ratio doubles from setting to setting.
    fn falling(psnr: [f64; 4]) -> Results {
        let mut results = Results::default();
        let mut scene = scene("", "s", Method::Gs3d);
        for (k, psnr) in psnr.into_iter().enumerate() {
            let power = f64::from(u8::try_from(k).unwrap());
            scene.points.push(Point {
                fps: Some(fps(10.0, 20.0 + 3.0 * power * power)),
                ..point(Setting::Tolerance(0.5 * (power + 1.0)), 16.0 / power.exp2(), Some(psnr))
            });
        }
        results.scenes.push(scene);
        results
    }

    #[test]
    fn slopes_by_hand() {
        let text = saturation(&falling([50.0, 44.0, 40.0, 38.0])).join("");
        assert_eq!(
            text.replace('\u{a0}', " "),
            "3DGS. Along tolerances each doubling of the coefficient ratio costs 6.0 dB at first (tol 0.5 to tol 1) and costs \
             2.0 dB at last (tol 1.5 to tol 2): the curve flattens. FPS on CPU are 20.0 at tol 0.5 and 47.0 at tol \
             2, 10.0 from dense SH; a doubling of the ratio brings +15.0 % at first and +75.0 % at last."
        );
        assert!(saturation(&falling([50.0, 44.0, 40.0, 35.0]))[0].contains("keeps falling"));
        assert!(saturation(&falling([50.0, 44.0, 40.0, 20.0]))[0].contains("steeper"));
        assert!(saturation(&falling([50.0, 44.0, 40.0, 41.0]))[0].contains("gains 1.0"));
    }

    #[test]
    fn a_difference_within_what_the_same_drawing_varies_by_is_no_trend() {
        let told = |dense: [f64; 2]| {
            let mut results = falling([50.0, 44.0, 40.0, 38.0]);
            for (k, point) in results.scenes[0].points.iter_mut().enumerate() {
                point.fps = Some(fps(dense[k % 2], [20.0, 20.2, 20.1, 21.9][k]));
            }
            saturation(&results).join("").replace('\u{a0}', " ")
        };
        // Rounds of one measurement vary by 5 % to each side.
        let text = told([10.0, 10.0]);
        assert!(text.ends_with(
            "FPS on CPU are 20.0 at tol 0.5 and 21.9 at tol 2, 10.0 from dense SH; they differ by less than the 10.0 % that \
             drawing the same dense SH varies by, so no trend can be told."
        ), "{text}");
        let mut results = falling([50.0, 44.0, 40.0, 38.0]);
        // The first step is within that, so only the ends are told.
        for (point, sparse) in results.scenes[0].points.iter_mut().zip([20.0, 20.2, 26.0, 40.0]) {
            point.fps = Some(fps(10.0, sparse));
        }
        let text = saturation(&results).join("");
        assert!(!text.contains("doubling of the ratio brings") && !text.contains("no trend"), "{text}");
        // So do measurements of the same at different times.
        assert!(told([10.0, 12.0]).contains("less than the 28.2 % that"), "{}", told([10.0, 12.0]));
    }

    #[test]
    fn caps_and_the_floor_are_told() {
        let text = saturation(&results());
        assert_eq!(text.len(), 1, "MCMC has one step only");
        assert!(text[0].contains("at most one nonzero in every Gaussian (ratio 50.0) PSNR is 29.00"));
        assert!(text[0].contains("dropped altogether it is 25.00"));
        assert!(saturation(&Results::default()).is_empty());
    }

    #[test]
    fn settings_of_one_ratio_have_no_slope() {
        let mut results = falling([50.0, 44.0, 40.0, 35.0]);
        for point in &mut results.scenes[0].points {
            point.coefficient_ratio = Some(4.0);
        }
        assert!(saturation(&results).is_empty());
    }
}
