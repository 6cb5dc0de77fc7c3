//! A preconditioner that the caller brings.

use std::fmt;
use std::sync::Mutex;

use super::Preconditioner;
use crate::error::{Error, Result};
use crate::operator::Operator;

type Apply = dyn Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync;

/// `M⁻¹` as a closure or an operator (of which it takes products; they are not counted, so it should be a cheap one:
/// a model of the scene, not the rig).
pub struct UserPreconditioner {
    size: Option<usize>,
    positive_definite: bool,
    apply: Box<Apply>,
}

impl UserPreconditioner {
    /// `M⁻¹ r` by a closure `(r, z)` that overwrites `z`. `positive_definite` is the caller's word for it.
    pub fn closure(
        positive_definite: bool,
        apply: impl Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync + 'static,
    ) -> Self {
        Self { size: None, positive_definite, apply: Box::new(apply) }
    }

    /// `M⁻¹` is this operator, which must be square.
    ///
    /// # Errors
    /// [`Error::Dimension`] when it is not.
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
            // A poisoned lock means that an earlier product panicked; the operator's own state is its own affair.
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
