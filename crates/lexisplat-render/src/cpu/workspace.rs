//! The memory of a picture, kept from one picture to the next.

use super::order::Order;
use super::tiles::TileLists;
use super::visible::Visible;

/// What drawing a picture makes on the way, about 90 bytes for each Gaussian. The next picture overwrites it.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    pub(super) visible: Visible,
    pub(super) order: Order,
    pub(super) lists: TileLists,
}
