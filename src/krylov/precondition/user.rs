//! User preconditioners.

use std::fmt;
use std::sync::Mutex;

use super::Preconditioner;
use crate::error::{Error, Result};
use crate::operator::Operator;

type Apply = dyn Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync;

/// A preconditioner `M⁻¹` of the caller: a closure or an operator. Products with this operator are not
/// counted, so it should be a cheap one, such as a model of the scene.
pub struct UserPreconditioner {
    size: Option<usize>,
    positive_definite: bool,
    apply: Box<Apply>,
}

impl UserPreconditioner {
    /// `M⁻¹ r` by a closure `(r, z)` that overwrites `z`. `positive_definite` is taken on trust.
    pub fn closure(
        positive_definite: bool,
        apply: impl Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync + 'static,
    ) -> Self {
        Self { size: None, positive_definite, apply: Box::new(apply) }
    }

    /// `M⁻¹` as an operator, which must be square.
    ///
    /// # Errors
    /// [`Error::Dimension`] when it is not square.
    pub fn operator(positive_definite: bool, operator: impl Operator + Send + 'static) -> Result<Self> {
        let (rows, cols) = (operator.rows(), operator.cols());
        if rows != cols {
            return Err(Error::Dimension {
                what: "an operator used as preconditioner",
                expected: "as many rows as columns".into(),
                found: format!("{rows}x{cols}"),
            });
        }
        let operator = Mutex::new(operator);
        let apply = move |r: &[f64], z: &mut [f64]| {
            // A poisoned lock means that an earlier product panicked. The operator is responsible for its own
            // state.
            let mut operator = operator.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            operator.apply(r, z)
        };
        Ok(Self { size: Some(rows), positive_definite, apply: Box::new(apply) })
    }
}

impl fmt::Debug for UserPreconditioner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UserPreconditioner")
            .field("size", &self.size)
            .field("positive_definite", &self.positive_definite)
            .finish_non_exhaustive()
    }
}

impl Preconditioner for UserPreconditioner {
    fn size(&self) -> Option<usize> {
        self.size
    }
    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        (self.apply)(r, z)
    }
    fn is_positive_definite(&self) -> bool {
        self.positive_definite
    }
}
