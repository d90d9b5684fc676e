//! The extension module of the Python package `brickwalk`: a scene whose rays are traced, and whose pictures are
//! rendered, by a thread of its own.
//!
//! The package around it, in `python/brickwalk/`, brings arguments into shape. What comes here are arrays of float32 or
//! float64 with one row a ray or a point, and what goes out fills arrays that the package has made.
//!
//! | file | what is in it |
//! | --- | --- |
//! | `worker` | a thread that owns what is open; waiting for it lets signals in |
//! | `held` | what a scene's thread owns |
//! | `rows` | rows of arrays as rays and points, and what is wrong with them |
//! | `scene` | the class that the package wraps |
//! | `render` | pictures |
//! | `parts` | frames of a walk that are rendered apart |
//! | `query` | intersections, nearest points, what is inside |
//! | `build` | scene files from arrays and from models |
//! | `shared` | conversions whose tasks other processes do |
//! | `errors` | errors as exceptions |

use pyo3::prelude::*;

mod build;
mod errors;
mod held;
mod parts;
mod query;
mod render;
mod rows;
mod scene;
mod shared;
mod worker;

#[pymodule]
fn _brickwalk(module: &Bound<'_, PyModule>) -> PyResult<()> {
    worker::note_process();
    module.add("BrickwalkError", module.py().get_type::<errors::BrickwalkError>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<scene::Core>()?;
    module.add_class::<parts::WalkParts>()?;
    module.add_function(wrap_pyfunction!(build::build_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(build::convert, module)?)?;
    module.add_class::<shared::ConversionWorker>()?;
    module.add_function(wrap_pyfunction!(shared::convert_shared, module)?)?;
    module.add_function(wrap_pyfunction!(build::generate, module)?)?;
    module.add_function(wrap_pyfunction!(render::pinhole, module)?)
}
