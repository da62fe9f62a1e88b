//! The properties that all tiles of a scene must have in common.

use serde::{Deserialize, Serialize};

use super::extra::ScalarType;
use super::sh::ShDegree;
use super::splats::{SceneMeta, Splats};
use crate::support::error::{Error, Result};

/// The properties in which all tiles of a scene agree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TileKind {
    pub(crate) degree: ShDegree,
    pub(crate) meta: SceneMeta,
    pub(crate) extras: Vec<(String, ScalarType)>,
}

impl TileKind {
    pub(crate) fn of(empty: &Splats) -> Self {
        let extras = &empty.geometry.extras;
        Self {
            degree: empty.degree,
            meta: empty.meta.clone(),
            extras: extras.iter().map(|extra| (extra.name.clone(), extra.values.scalar_type())).collect(),
        }
    }

    /// Refuses a tile that has no Gaussians, or that does not agree with `before`. `gaussians` is the number of Gaussians
    /// of the tile.
    pub(crate) fn check(&self, name: &str, before: Option<&Self>, gaussians: u64) -> Result<()> {
        let wrong = match before.and_then(|before| before.difference(self)) {
            _ if gaussians == 0 => "no Gaussians".to_owned(),
            Some(difference) => difference,
            None => return Ok(()),
        };
        Err(Error::malformed(name, format!("the tile has {wrong}")))
    }

    /// Returns a description of the first property in which `next` does not agree with `self`; `None` if they agree.
    pub(crate) fn difference(&self, next: &Self) -> Option<String> {
        if self.degree != next.degree {
            let (own, other) = (self.degree.get(), next.degree.get());
            return Some(format!("SH degree {other}, where the tiles before have degree {own}"));
        }
        if self.meta.antialiased != next.meta.antialiased {
            return Some("another antialiasing mark than the tiles before".to_owned());
        }
        let names = |extras: &[(String, ScalarType)]| {
            let all = extras.iter().map(|(name, kind)| format!("{name} ({})", kind.name()));
            if extras.is_empty() { "none".to_owned() } else { all.collect::<Vec<_>>().join(", ") }
        };
        (self.extras != next.extras).then(|| {
            format!(
                "the extra properties {}, where the tiles before have {}; leave extras out to go on",
                names(&next.extras),
                names(&self.extras)
            )
        })
    }
}
