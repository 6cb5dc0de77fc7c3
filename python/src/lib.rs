//! The native part of krylux's Python package: thin classes around [`krylux::lab::Lab`] and its answers. The Python sources beside it
//! check arguments, and give these classes their names and documentation.
//!
//! | file | holds |
//! |---|---|
//! | `work` | calls without the interpreter's lock; exceptions, panics and forks |
//! | `errors` | errors of krylux as exceptions |
//! | `watch` | progress, messages and signals |
//! | `settings` | the arguments of `krylux.open` |
//! | `lab`, `verbs`, `answers` | the laboratory, its questions, and what can be saved |
//! | `matrix`, `operator`, `arrays` | matrices, products and pictures as arrays |
//! | `krylov` | krylux's solvers on operators of Python |
//! | `pictures`, `figures` | pictures from files and their comparison, and the paper's figures |
//! | `devices`, `bench` | cameras and projectors of Python, and the devices of a rig |

mod answers;
mod arrays;
mod bench;
mod devices;
mod errors;
mod figures;
mod krylov;
mod lab;
mod matrix;
mod operator;
mod pictures;
mod settings;
mod verbs;
mod watch;
mod work;

use pyo3::prelude::*;

/// The native part of the package.
#[pymodule]
fn _krylux(module: &Bound<'_, PyModule>) -> PyResult<()> {
    work::note_process();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<answers::Answer>()?;
    module.add_class::<figures::Figures>()?;
    module.add_class::<lab::Lab>()?;
    module.add_class::<matrix::Matrix>()?;
    module.add_class::<operator::Operator>()?;
    module.add_class::<bench::Preview>()?;
    module.add_function(wrap_pyfunction!(verbs::verbs, module)?)?;
    module.add_function(wrap_pyfunction!(krylov::solve, module)?)?;
    module.add_function(wrap_pyfunction!(krylov::eigenpairs, module)?)?;
    module.add_function(wrap_pyfunction!(krylov::trace, module)?)?;
    module.add_function(wrap_pyfunction!(krylov::svd, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::read_picture, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::compare, module)?)?;
    module.add_function(wrap_pyfunction!(figures::reproduce, module)?)?;
    module.add_function(wrap_pyfunction!(bench::attached, module)?)?;
    module.add_function(wrap_pyfunction!(bench::ask_rig, module)?)
}
