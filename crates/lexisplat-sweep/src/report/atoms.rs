//! The dictionary as data for the page's script. The script draws each atom as a ball.

use lexisplat::Model;

/// Number of atoms shown, the most used first.
const SHOWN: usize = 180;
/// Number of steps in 1 for coefficients, which become whole numbers. A thousandth is finer than any screen shows.
const STEPS: f32 = 1000.0;

/// The numbers of uses of atoms.
pub(super) struct Usage {
    /// (atom, number of Gaussians that use it), the most used first.
    pub(super) ranked: Vec<(usize, u64)>,
}

impl Usage {
    pub(super) fn of(model: &Model) -> Self {
        let mut users = vec![0_u64; model.dictionary().len()];
        let indices = model.codes().indices();
        for k in 0..model.codes().nonzeros() {
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

/// Returns `{"degree":3,"atoms":[[...],...]}` of the shown atoms, with coefficients in thousandths.
pub(super) fn json(model: &Model, usage: &Usage) -> String {
    let thousandths = |value: &f32| (value * STEPS).round();
    #[expect(clippy::cast_possible_truncation, reason = "a coefficient of a unit vector, in thousandths")]
    let atom = |&(atom, _): &(usize, u64)| {
        model.dictionary().atom(atom).iter().map(thousandths).map(|v| v as i32).collect::<Vec<_>>()
    };
    let atoms: Vec<_> = usage.shown().iter().map(atom).collect();
    serde_json::json!({ "degree": model.degree().get(), "atoms": atoms }).to_string()
}
