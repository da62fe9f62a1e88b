//! The native part of the Python package `lexisplat`. It takes and returns NumPy arrays.
//!
//! Everything here is private to the package. The Python modules of the package check and document the arguments, and turn the
//! results of this module into the classes that users see. Start reading at `scene`, which holds a compressed scene, and `arrays`,
//! which converts arrays. Long work runs on a thread of its own without the GIL (`work`), so that Ctrl-C and progress reports
//! reach Python.

mod arrays;
mod bytes;
mod cameras;
mod choices;
mod chunks;
mod draw;
mod errors;
mod files;
mod held;
mod invalid;
mod learn;
mod metrics;
mod scene;
mod subject;
mod tiles;
mod work;

use pyo3::prelude::*;

/// The native part of the package.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::arrays::contiguous;
    #[pymodule_export]
    use crate::cameras::{orbit, photographs, read_cameras};
    #[pymodule_export]
    use crate::choices::compress;
    #[pymodule_export]
    use crate::chunks::Chunks;
    #[pymodule_export]
    use crate::draw::{compare, render};
    #[pymodule_export]
    use crate::files::{load, save};
    #[pymodule_export]
    use crate::learn::{Statistics, encode_rows, learn_rows};
    #[pymodule_export]
    use crate::metrics::score;
    #[pymodule_export]
    use crate::scene::{Scene, open_scene};
    #[pymodule_export]
    use crate::tiles::{
        TileSample, tile_assemble, tile_check, tile_choices, tile_code, tile_coding, tile_finish, tile_look,
        tile_open, tile_plan, tile_runs, tile_scatter, tile_steps, tile_survey, tile_tables,
    };
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("TILE_BLOCK", lexisplat::packed::tiles::BLOCK)
    }
}
