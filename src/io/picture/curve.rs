//! Curves from encoded to linear values.

use crate::io::raster::decode_srgb;

pub(super) enum Curve {
    /// IEC 61966-2-1.
    Srgb,
    /// `(a·x + b)^g + e` from `x = d` on, and `c·x + f` below.
    Segments { g: f32, a: f32, b: f32, c: f32, d: f32, e: f32, f: f32 },
    /// Linear values at equal steps from 0 to 1, with straight lines between them.
    Table(Vec<f32>),
}

impl Curve {
    pub(super) const LINEAR: Self =
        Self::Segments { g: 1.0, a: 0.0, b: 0.0, c: 1.0, d: f32::INFINITY, e: 0.0, f: 0.0 };

    /// The inverse of the camera's curve of ITU-R BT.709, with the digits of BT.2020.
    pub(super) const BT709: Self = Self::Segments {
        g: 1.0 / 0.45,
        a: 1.0 / 1.099_296_8,
        b: 0.099_296_8 / 1.099_296_8,
        c: 1.0 / 4.5,
        d: 4.5 * 0.018_053_97,
        e: 0.0,
        f: 0.0,
    };

    pub(super) const fn power(g: f32) -> Self {
        Self::Segments { g, a: 1.0, b: 0.0, c: 0.0, d: 0.0, e: 0.0, f: 0.0 }
    }

    /// The linear value of an encoded one.
    pub(super) fn at(&self, encoded: f32) -> f32 {
        match self {
            Self::Srgb => decode_srgb(encoded),
            &Self::Segments { g, a, b, c, d, e, f } => {
                if encoded >= d {
                    (a * encoded + b).powf(g) + e
                } else {
                    c * encoded + f
                }
            }
            Self::Table(levels) => {
                let Some(last) = levels.len().checked_sub(1) else { return f32::NAN };
                let place = encoded * last as f32;
                let below = (place as usize).min(last);
                let above = (below + 1).min(last);
                levels[below] + (place - below as f32) * (levels[above] - levels[below])
            }
        }
    }

    pub(super) fn is_linear(&self) -> bool {
        (0..=16).map(|step| step as f32 / 16.0).all(|x| (self.at(x) - x).abs() < 1e-4)
    }
}
