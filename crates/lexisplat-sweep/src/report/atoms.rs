//! The dictionary as data for the page's script, which draws each atom as a ball.

use std::fmt::Write;

use lexisplat::Model;

/// Atoms shown, the most used first.
const SHOWN: usize = 180;
/// Steps of a coefficient in the page: a thousandth is finer than any screen shows.
const STEPS: f32 = 1000.0;

/// How often atoms are used.
pub(super) struct Usage {
    /// (atom, Gaussians that use it), the most used first.
    pub(super) ranked: Vec<(usize, u64)>,
}

impl Usage {
    pub(super) fn of(model: &Model) -> Self {
        let mut users = vec![0_u64; model.dictionary().len()];
        let indices = model.codes().indices();
        for k in 0..indices.len() {
            if let Some(users) = users.get_mut(indices.get(k)) {
                *users += 1;
            }
        }
        let mut ranked: Vec<(usize, u64)> = users.into_iter().enumerate().collect();
        ranked.sort_by_key(|&(atom, users)| (std::cmp::Reverse(users), atom));
        Self { ranked }
    }

    pub(super) fn shown(&self) -> &[(usize, u64)] {
        &self.ranked[..self.ranked.len().min(SHOWN)]
    }
}

/// `{"degree":3,"atoms":[[...],...]}` of the shown atoms, coefficients in thousandths.
pub(super) fn json(model: &Model, usage: &Usage) -> String {
    let mut out = format!("{{\"degree\":{},\"atoms\":[", model.degree());
    for (k, &(atom, _)) in usage.shown().iter().enumerate() {
        out.push_str(if k == 0 { "[" } else { ",[" });
        for (i, value) in model.dictionary().atom(atom).iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            let _ = write!(out, "{comma}{:.0}", value * STEPS);
        }
        out.push(']');
    }
    out.push_str("]}");
    out
}
