//! Givens rotations.

/// `(c, s, ρ)` with `[c s; −s c] [a; b] = [ρ; 0]`, `ρ ≥ 0`; the identity for `a = b = 0`.
pub(super) fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    let length = a.hypot(b);
    if length == 0.0 { (1.0, 0.0, 0.0) } else { (a / length, b / length, length) }
}
