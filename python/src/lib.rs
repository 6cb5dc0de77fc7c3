//! The native part of krylux's Python package: thin classes around [`krylux::lab::Lab`] and its answers. The Python sources of the package
//! check arguments, and give these classes their names and documentation.
//!
//! | file | holds |
//! |---|---|
//! | `work` | calls without the interpreter's lock; exceptions, panics and forks |
//! | `errors` | errors of krylux as exceptions |
//! | `watch` | progress, messages and signals |
//! | `settings` | the arguments of `krylux.open` |
//! | `scene` | scenes that Python makes or changes |
//! | `lab`, `verbs` | the laboratory, its requests, and answers that can be saved |
//! | `matrix`, `operator`, `arrays` | matrices, products and pictures as arrays |
//! | `krylov` | krylux's solvers, applied to operators written in Python |
//! | `figures` | pictures from files and their comparison, and the paper's figures |
//! | `devices`, `bench` | cameras and projectors written in Python, and the devices of a rig |

mod arrays;
mod bench;
mod devices;
mod errors;
mod figures;
mod krylov;
mod lab;
mod matrix;
mod operator;
mod scene;
mod settings;
mod verbs;
mod watch;
mod work;

/// The native part of the package.
#[pyo3::pymodule]
mod _krylux {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::bench::{Preview, ask_rig};
    #[pymodule_export]
    use crate::figures::{Figures, compare, read_picture, reproduce};
    #[pymodule_export]
    use crate::krylov::{eigenpairs, solve, svd, trace};
    #[pymodule_export]
    use crate::lab::Lab;
    #[pymodule_export]
    use crate::matrix::Matrix;
    #[pymodule_export]
    use crate::operator::Operator;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::verbs::{Answer, verbs};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::work::note_process();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
