//! Statistics of a scene's values, and warnings about them.
//!
//! These are the numbers behind `lexisplat info`. Sums are taken over fixed blocks of Gaussians and added in order, so the
//! result does not depend on the number of threads or on the parts in which a scene comes.

use std::ops::Range;

use serde::Serialize;

use crate::scene::extra::for_extra;
use crate::scene::splats::Splats;
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_vec};

/// Lower edges of the bins of [`Lint::rest_norms`]. The last bin is open above. The tolerances in use, 0.03 to 0.3, are
/// edges, so that the bins below a tolerance hold the Gaussians that need no atom at all.
pub const NORM_BINS: [f64; 9] = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0];

/// Logarithmic scale above which a Gaussian is huge: its standard deviation is over 22,000 units. Trainers normalise scenes
/// to a few units, so such a Gaussian is debris that covers the whole picture.
pub const HUGE_LOG_SCALE: f32 = 10.0;

/// Opacity below which the INRIA rasteriser skips a Gaussian at its very centre (`forward.cu`, `alpha < 1.0f / 255.0f`). It
/// is `logit(1 / 255)`.
pub const NEVER_DRAWN_OPACITY: f32 = -5.537_334;

/// Smallest number of Gaussians whose values tell whether they are activated already.
const TELLING: u64 = 16;

/// Largest difference between 1 and the length of a quaternion that counts as unit.
pub const UNIT_TOLERANCE: f64 = 1e-3;

/// Range and mean of one property over all Gaussians, without NaN.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AttributeStats {
    /// The property's name; `f_rest` stands for all SH-rest values together.
    pub name: String,
    /// Smallest value; 0 for an empty scene.
    pub min: f64,
    /// Largest value; 0 for an empty scene.
    pub max: f64,
    /// Mean; 0 for an empty scene.
    pub mean: f64,
}

/// The result of [`lint`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Lint {
    /// Number of Gaussians in the scene.
    pub gaussians: u64,
    /// Range and mean of each property, in the order of the INRIA layout; extras last.
    pub attributes: Vec<AttributeStats>,
    /// Number of Gaussians in each bin of [`NORM_BINS`], by the L2 norm of the SH-rest vector.
    pub rest_norms: [u64; NORM_BINS.len()],
    /// Mean L2 norm of the SH-rest vectors.
    pub mean_rest_norm: f64,
    /// Number of Gaussians whose SH-rest is all zero.
    pub zero_rest: u64,
    /// Number of quaternions of length 0, which have no direction to normalise.
    pub zero_quaternions: u64,
    /// Number of quaternions that are neither unit (within [`UNIT_TOLERANCE`]) nor zero. Such quaternions are harmless,
    /// since renderers normalise.
    pub non_unit_quaternions: u64,
    /// Number of Gaussians with a logarithmic scale over [`HUGE_LOG_SCALE`].
    pub huge_scales: u64,
    /// Number of Gaussians with an opacity below [`NEVER_DRAWN_OPACITY`].
    pub never_drawn: u64,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

/// Computes the statistics of a scene.
///
/// # Errors
/// [`crate::Error::Parameter`] if the scene's arrays differ in length.
pub fn lint(splats: &Splats) -> crate::Result<Lint> {
    let mut linter = Linter::default();
    linter.add(splats)?;
    Ok(linter.finish())
}

/// The computation of [`lint`] for a scene that comes part after part.
#[derive(Debug, Default)]
pub struct Linter {
    gaussians: u64,
    view_dependent: bool,
    counts: Blocks<Counts>,
    /// Name, range and sum of each property.
    columns: Vec<(String, Blocks<Span>)>,
}

/// A sum over Gaussians. Blocks of [`GAUSSIANS_PER_TASK`] Gaussians are summed by themselves, and their sums are added in
/// order.
#[derive(Debug, Clone, Default)]
struct Blocks<T> {
    /// Sum of all blocks that are full.
    full: T,
    /// Sum of the last block, which is not full.
    open: T,
}

impl<T: Add + Default + Send + Sync> Blocks<T> {
    /// Adds `len` Gaussians, of which the first has number `start` in the scene. `sum` adds the Gaussians of a range, which
    /// counts from `start`, to a sum.
    fn add(&mut self, start: u64, len: usize, sum: impl Fn(Range<usize>, T) -> T + Sync) {
        let before = usize::try_from(start % GAUSSIANS_PER_TASK as u64).unwrap_or(0);
        let mut open = Some(std::mem::take(&mut self.open));
        let ends = (GAUSSIANS_PER_TASK - before..).step_by(GAUSSIANS_PER_TASK);
        let mut blocks = Vec::new();
        let mut first = 0;
        for end in ends.take_while(|&end| end < len + GAUSSIANS_PER_TASK) {
            blocks.push((first..end.min(len), open.take().unwrap_or_default()));
            first = end.min(len);
        }
        let full = (before + len) / GAUSSIANS_PER_TASK;
        for (block, sum) in map_vec(blocks, |(range, from)| sum(range, from)).into_iter().enumerate() {
            if block < full { self.full.add(&sum) } else { self.open = sum }
        }
    }

    /// Returns the sum of all blocks.
    fn finish(mut self) -> T {
        self.full.add(&self.open);
        self.full
    }
}

/// A quantity that is summed over blocks.
trait Add {
    /// Adds the sum of the next block.
    fn add(&mut self, next: &Self);
}

impl Linter {
    /// Adds the next Gaussians. All parts must be of one scene and have the same properties. The bits of the result do not
    /// depend on how the scene is cut into parts.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the part's arrays differ in length.
    pub fn add(&mut self, splats: &Splats) -> crate::Result<()> {
        splats.validate()?;
        let (start, len) = (self.gaussians, splats.len());
        self.counts.add(start, len, |range, counts| counts.and(splats, range));
        self.gaussians += len as u64;
        self.view_dependent = splats.degree.get() > 0;
        let columns = columns(splats);
        // An empty part may lack properties that other parts have.
        if start == 0 && self.columns.len() <= columns.len() {
            self.columns = columns.iter().map(|(name, _)| (name.clone(), Blocks::default())).collect();
        }
        for ((_, whole), (_, sum)) in self.columns.iter_mut().zip(columns) {
            whole.add(start, len, sum);
        }
        Ok(())
    }

    /// Returns the statistics of all parts together.
    #[must_use]
    pub fn finish(self) -> Lint {
        let (n, counts) = (self.gaussians, self.counts.finish());
        let [zero_rest, zero_quaternions, non_unit_quaternions, huge_scales, never_drawn] = counts.odd;
        let mut lint = Lint {
            gaussians: n,
            attributes: self
                .columns
                .into_iter()
                .map(|(name, whole)| whole.finish().into_report(name))
                .collect(),
            rest_norms: counts.rest_norms,
            mean_rest_norm: if n == 0 { 0.0 } else { counts.norm_sum / n as f64 },
            zero_rest,
            zero_quaternions,
            non_unit_quaternions,
            huge_scales,
            never_drawn,
            warnings: Vec::new(),
        };
        lint.warnings = warnings(&lint, self.view_dependent);
        lint
    }
}

fn warnings(lint: &Lint, view_dependent: bool) -> Vec<String> {
    let n = lint.gaussians;
    if n == 0 {
        return vec!["The scene holds no Gaussians.".to_owned()];
    }
    let mut out = Vec::new();
    let mut warn = |count: u64, what: &str| {
        if count > 0 {
            let percent = 100.0 * count as f64 / n as f64;
            out.push(format!("{count} of {n} Gaussians ({percent:.2} %) {what}."));
        }
    };
    warn(lint.zero_quaternions, "have a rotation of length 0, which no renderer can normalise");
    warn(lint.huge_scales, "have a logarithmic scale over 10 and may cover the whole picture");
    warn(lint.never_drawn, "are too transparent to be drawn (opacity under 1/255)");
    out.extend(activated(lint));
    if view_dependent && lint.zero_rest == n {
        out.push(
            "All SH-rest values are 0: the scene has the size of its degree but no view dependence.".into(),
        );
    }
    out
}

/// Returns warnings about opacities that look as if their sigmoid had been taken already, and about scales that look as if
/// their exponential had. Renderers would take both once more. About half of all logits are negative, and so are the
/// logarithms of all sizes below one unit.
fn activated(lint: &Lint) -> Vec<String> {
    let of = |name: &str| lint.attributes.iter().find(|a| a.name == name);
    let scales: Vec<_> = ["scale_0", "scale_1", "scale_2"].iter().filter_map(|name| of(name)).collect();
    let mut out = Vec::new();
    if lint.gaussians < TELLING {
        return out;
    }
    if of("opacity").is_some_and(|a| a.min >= 0.0 && a.max <= 1.0 && a.min < a.max) {
        out.push(
            "All opacities are between 0 and 1: they look as if they were activated already. A PLY holds logits, whose sigmoid \
             renderers take."
                .to_owned(),
        );
    }
    // If these values were logarithms, no size would be below 1 unit, and the geometric mean of the sizes would be below e
    // units. Such a scene would be of boulders.
    if !scales.is_empty() && scales.iter().all(|a| a.min > 0.0 && a.mean < 1.0) {
        out.push(
            "All scales are above 0 and small: they look as if they were activated already. A PLY holds logarithms of sizes, whose \
             exponential renderers take."
                .to_owned(),
        );
    }
    out
}

/// Counts and sums over some Gaussians.
#[derive(Debug, Default)]
struct Counts {
    rest_norms: [u64; NORM_BINS.len()],
    norm_sum: f64,
    /// [`Lint::zero_rest`] and the four counts that follow it.
    odd: [u64; 5],
}

impl Counts {
    /// Returns these counts plus the counts of the Gaussians of `range`.
    fn and(mut self, splats: &Splats, range: Range<usize>) -> Self {
        let norm = |values: &[f32]| values.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt();
        let counts = &mut self;
        let geometry = &splats.geometry;
        for i in range {
            let rest = splats.rest(i);
            let length = norm(rest);
            // A NaN length falls into the first bin.
            let bin = NORM_BINS.iter().rposition(|&edge| length >= edge).unwrap_or(0);
            counts.rest_norms[bin] += 1;
            counts.norm_sum += length;
            let turn = norm(&geometry.rotations[i]);
            let odd = [
                rest.iter().all(|&v| v == 0.0),
                turn == 0.0,
                turn != 0.0 && (turn - 1.0).abs() > UNIT_TOLERANCE,
                geometry.scales[i].iter().any(|&s| s > HUGE_LOG_SCALE),
                geometry.opacities[i] < NEVER_DRAWN_OPACITY,
            ];
            counts.odd.iter_mut().zip(odd).for_each(|(count, odd)| *count += u64::from(odd));
        }
        self
    }
}

impl Add for Counts {
    fn add(&mut self, other: &Self) {
        self.rest_norms.iter_mut().zip(other.rest_norms).for_each(|(a, b)| *a += b);
        self.odd.iter_mut().zip(other.odd).for_each(|(a, b)| *a += b);
        self.norm_sum += other.norm_sum;
    }
}

/// Range, sum and number of values.
#[derive(Debug, Clone, Copy)]
struct Span {
    min: f64,
    max: f64,
    sum: f64,
    count: u64,
}

impl Default for Span {
    fn default() -> Self {
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, sum: 0.0, count: 0 }
    }
}

impl Add for Span {
    fn add(&mut self, next: &Self) {
        self.min = self.min.min(next.min);
        self.max = self.max.max(next.max);
        self.sum += next.sum;
        self.count += next.count;
    }
}

impl Span {
    fn into_report(self, name: String) -> AttributeStats {
        match self.count {
            0 => AttributeStats { name, min: 0.0, max: 0.0, mean: 0.0 },
            count => AttributeStats { name, min: self.min, max: self.max, mean: self.sum / count as f64 },
        }
    }
}

/// A function that adds the values of some Gaussians to a span.
type Sum<'a> = Box<dyn Fn(Range<usize>, Span) -> Span + Sync + 'a>;

/// Returns all properties of a scene: for each its name, and a function that sums its values.
fn columns(splats: &Splats) -> Vec<(String, Sum<'_>)> {
    let (geometry, dim) = (&splats.geometry, splats.degree.rest());
    let mut out = of_rows(&["x", "y", "z"], geometry.positions.as_flattened());
    if !geometry.normals.is_empty() {
        out.extend(of_rows(&["nx", "ny", "nz"], geometry.normals.as_flattened()));
    }
    out.extend(of_rows(&["f_dc_0", "f_dc_1", "f_dc_2"], geometry.dc.as_flattened()));
    if dim > 0 {
        let all = every(&splats.sh_rest, 0, 1);
        let sum: Sum<'_> = Box::new(move |rows, span| all(rows.start * dim..rows.end * dim, span));
        out.push(("f_rest".to_owned(), sum));
    }
    out.extend(of_rows(&["opacity"], &geometry.opacities));
    out.extend(of_rows(&["scale_0", "scale_1", "scale_2"], geometry.scales.as_flattened()));
    out.extend(of_rows(&["rot_0", "rot_1", "rot_2", "rot_3"], geometry.rotations.as_flattened()));
    for extra in &geometry.extras {
        out.push((extra.name.clone(), for_extra!(&extra.values, v => every(v, 0, 1))));
    }
    out
}

/// Returns the properties in the columns of `values`. Each row has one value for each of `names`.
fn of_rows<'a>(names: &[&str], values: &'a [f32]) -> Vec<(String, Sum<'a>)> {
    let column = |(column, name): (usize, &&str)| ((*name).to_owned(), every(values, column, names.len()));
    names.iter().enumerate().map(column).collect()
}

/// Returns a function that sums every `width`-th value from `column` on, except NaN.
fn every<T: Copy + Into<f64> + Sync>(values: &[T], column: usize, width: usize) -> Sum<'_> {
    Box::new(move |rows, mut span| {
        for row in rows {
            let value: f64 = values[row * width + column].into();
            if !value.is_nan() {
                span.add(&Span { min: value, max: value, sum: value, count: 1 });
            }
        }
        span
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extra, ExtraValues, Geometry, SceneMeta, ShDegree};

    fn scene(n: usize) -> Splats {
        Splats {
            geometry: Geometry {
                positions: vec![[1.0, 2.0, 3.0]; n],
                dc: vec![[0.0; 3]; n],
                opacities: vec![0.0; n],
                scales: vec![[-3.0; 3]; n],
                rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
                ..Geometry::default()
            },
            degree: ShDegree::new(1).unwrap(),
            sh_rest: vec![0.0; 9 * n],
            meta: SceneMeta::default(),
        }
    }

    #[test]
    fn each_oddity_is_counted_once() {
        // The scene has several chunks, with oddities in the last chunk.
        let n = 2 * GAUSSIANS_PER_TASK + 10;
        let mut s = scene(n);
        s.geometry.rotations[n - 1] = [0.0; 4];
        s.geometry.rotations[n - 2] = [2.0, 0.0, 0.0, 0.0];
        s.geometry.scales[n - 3][1] = 10.5;
        s.geometry.opacities[n - 4] = -5.54;
        s.geometry.opacities[n - 5] = -5.53;
        s.sh_rest[9 * (n - 1)] = 3.0;
        s.sh_rest[9 * (n - 1) + 8] = 4.0;
        s.geometry.positions[n - 1][2] = 3.0 + n as f32;
        s.geometry.extras = vec![Extra { name: "red".into(), values: ExtraValues::U8([0, 1].repeat(n / 2)) }];
        let lint = lint(&s).unwrap();
        assert_eq!(lint.gaussians, n as u64);
        assert_eq!((lint.zero_quaternions, lint.non_unit_quaternions), (1, 1));
        assert_eq!((lint.huge_scales, lint.never_drawn, lint.zero_rest), (1, 1, n as u64 - 1));
        assert_eq!(lint.rest_norms, [n as u64 - 1, 0, 0, 0, 0, 0, 1, 0, 0]);
        assert!((lint.mean_rest_norm - 5.0 / n as f64).abs() < 1e-12);
        assert_eq!(lint.warnings.len(), 3, "{:?}", lint.warnings);
        let stats = |name: &str| lint.attributes.iter().find(|a| a.name == name).unwrap();
        let z = stats("z");
        assert_eq!((z.min, z.max), (3.0, 3.0 + n as f64));
        assert!((z.mean - 4.0).abs() < 1e-9);
        assert!((stats("red").mean - 0.5).abs() < 1e-9);
        assert_eq!(stats("f_rest").max, 4.0);
        assert_eq!(lint.attributes.last().unwrap().name, "red");
    }

    #[test]
    fn parts_of_any_length_give_the_same_bits() {
        let whole = crate::support::testing::scene(3 * GAUSSIANS_PER_TASK + 700, 3);
        let expected = lint(&whole).unwrap();
        for lengths in [&[1_usize][..], &[0, 700, 1347, 2048, 0, 5000], &[2048, 1, 4095]] {
            let mut linter = Linter::default();
            let (mut start, mut lengths) = (0, lengths.iter().copied().chain(std::iter::repeat(900)));
            while start < whole.len() {
                let end = whole.len().min(start + lengths.next().unwrap());
                let mut part = whole.clone();
                part.retain(&(0..whole.len()).map(|i| (start..end).contains(&i)).collect::<Vec<bool>>());
                linter.add(&part).unwrap();
                start = end;
            }
            assert_eq!(linter.finish(), expected);
        }
    }

    #[test]
    fn values_that_are_activated_already_are_warned_of() {
        let mut splats = crate::support::testing::scene(300, 3);
        assert_eq!(lint(&splats).unwrap().warnings, Vec::<String>::new());
        let geometry = &mut splats.geometry;
        geometry.opacities.iter_mut().for_each(|v| *v = 1.0 / (1.0 + (-*v).exp()));
        let said = lint(&splats).unwrap().warnings;
        assert!(said.len() == 1 && said[0].starts_with("All opacities are between 0 and 1"), "{said:?}");
        splats.geometry.scales.as_flattened_mut().iter_mut().for_each(|v| *v = v.exp());
        let said = lint(&splats).unwrap().warnings;
        assert!(said.len() == 2 && said[1].starts_with("All scales are above 0"), "{said:?}");
    }

    #[test]
    fn the_threshold_is_the_logit() {
        let alpha = 1.0 / 255.0_f64;
        assert!((f64::from(NEVER_DRAWN_OPACITY) - (alpha / (1.0 - alpha)).ln()).abs() < 1e-6);
    }

    #[test]
    fn flat_and_empty_scenes_are_mentioned() {
        let said = lint(&scene(3)).unwrap().warnings;
        assert!(said.len() == 1 && said[0].contains("no view dependence"), "{said:?}");
        let said = lint(&scene(0)).unwrap();
        assert_eq!(said.warnings, ["The scene holds no Gaussians."]);
        assert!(said.attributes.iter().all(|a| a.mean == 0.0));
    }
}
