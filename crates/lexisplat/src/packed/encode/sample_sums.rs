//! Sums over a sample of the Gaussians of a scene, from which predictors, limits and the dictionary are found.

use half::f16;
use serde::{Deserialize, Serialize};

use super::coder::{OrderedGaussians, SAMPLE_STREAM};
use super::fit::{Predictors, Steps};
use super::octaves::Histogram;
use super::settled::Begun;
use crate::packed::curve::MortonKey;
use crate::scene::sensitivity::AppearanceSensitivity;
use crate::scene::splats::{Geometry, Splats};
use crate::support::maths::Vec3;
use crate::support::rng::SplitMix64;

/// Share of the Gaussians whose base colours set the unit of base colours. The rest are too few to make all others coarse.
const USUAL_DC: f64 = 0.999;

/// Sums over a sample, and the rows that a dictionary is learned from.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(in crate::packed) struct SampleSums {
    pub(in crate::packed) predictors: Predictors,
    /// Most octaves by which the shape of a Gaussian asks for smaller steps than those of class 0.
    pub(in crate::packed) over: f32,
    /// Histogram of the largest coordinate of each base colour.
    dc: Histogram,
    /// Rows in units of their value steps, as bytes of 16-bit floats. They differ from the exact rows by far less than a
    /// step.
    rows: Vec<u8>,
    /// The colour class of each row.
    classes: Vec<u8>,
}

impl SampleSums {
    /// Adds the values of the Gaussians of `keys`, which follow one another in the file. `dc` has the base colours of
    /// `geometry`, and `sensitivities` has the order of `keys`.
    pub(in crate::packed) fn add_values(
        &mut self,
        geometry: &Geometry,
        dc: &[Vec3],
        keys: &[MortonKey],
        sensitivities: &[AppearanceSensitivity],
        steps: &Steps,
    ) {
        let classes = steps.classes_of(sensitivities);
        self.predictors.add(geometry, dc, keys, &classes, &steps.parameters);
        for key in keys {
            let largest = steps.parameters.dc_coordinates(dc[key.index()]).into_iter();
            self.dc.add(largest.fold(0.0_f32, |most, x| most.max(x.abs())));
        }
    }

    /// Adds the limits that the Gaussians of `keys` ask for, and about `wanted` of their rows, drawn by `seed`. These Gaussians
    /// stay. `sensitivities` has the order of `keys`.
    pub(in crate::packed) fn add_kept(
        &mut self,
        splats: &Splats,
        keys: &[MortonKey],
        sensitivities: &[AppearanceSensitivity],
        (steps, begun): (&Steps, &Begun),
        (wanted, seed): (usize, u64),
    ) {
        self.over = self.over.max(begun.floor.over(&splats.geometry, keys));
        let free = steps.classes_of(sensitivities);
        let classes = begun.floor.classes(&free, &splats.geometry, keys);
        let ordered = OrderedGaussians::new(splats, keys, &classes);
        let chosen = SplitMix64::new(seed ^ SAMPLE_STREAM).shuffled(keys.len()).take(wanted);
        let (rows, mut classes) = ordered.scaled(chosen, &begun.floor.parameters.for_learning());
        self.rows.extend(rows.into_iter().flat_map(half_bytes));
        self.classes.append(&mut classes);
    }

    /// Adds the sums and the rows of the next Gaussians.
    pub(in crate::packed) fn merge(&mut self, next: &Self) {
        self.predictors.merge(&next.predictors);
        self.over = self.over.max(next.over);
        self.dc.merge(&next.dc);
        self.rows.extend_from_slice(&next.rows);
        self.classes.extend_from_slice(&next.classes);
    }

    /// Returns whether there are `dim` values for each row.
    pub(in crate::packed) fn is_of(&self, dim: usize) -> bool {
        self.rows.len() == self.classes.len() * dim * size_of::<f16>()
    }

    /// Returns the largest coordinate of usual base colours.
    pub(in crate::packed) fn most_dc(&self) -> f64 {
        self.dc.quantile(USUAL_DC).into()
    }

    /// Returns the rows of `dim` values in random order, and their classes in the same order.
    pub(in crate::packed) fn shuffled(&self, dim: usize, seed: u64) -> (Vec<f32>, Vec<u8>) {
        let bytes = dim * size_of::<f16>();
        let (mut rows, mut classes) = (Vec::new(), Vec::new());
        for i in SplitMix64::new(seed ^ SAMPLE_STREAM).shuffled(self.classes.len()) {
            let row = self.rows[i * bytes..(i + 1) * bytes].chunks_exact(size_of::<f16>());
            rows.extend(row.map(|x| f16::from_le_bytes([x[0], x[1]]).to_f32()));
            classes.push(self.classes[i]);
        }
        (rows, classes)
    }
}

/// Returns the bytes of the finite 16-bit float nearest to `x`.
fn half_bytes(x: f32) -> [u8; 2] {
    let most = f16::MAX.to_f32();
    f16::from_f32(x.clamp(-most, most)).to_le_bytes()
}
