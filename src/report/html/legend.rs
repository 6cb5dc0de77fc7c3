//! Legends: the meaning of a picture's colours.

use crate::io::raster;
use crate::report::colormap;
use crate::report::palette::{MASKED_LABEL, Palette};

/// The legend of a figure.
#[derive(Clone, Debug, Default)]
pub enum Legend {
    /// No legend.
    #[default]
    None,
    /// Named colours.
    Swatches(Vec<Swatch>),
    /// A continuous scale.
    Scale {
        /// Colours from left to right.
        colors: Vec<[u8; 3]>,
        /// Numbers below the colours, from left to right.
        labels: Vec<String>,
        /// Unit of the numbers; empty for dimensionless values, such as the entries of a unit vector.
        unit: String,
    },
}

/// A colour and its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swatch {
    /// The colour, sRGB.
    pub color: [u8; 3],
    /// The meaning of the colour.
    pub text: String,
}

impl Legend {
    /// The groups of a label image with their numbers and their percentages of the pixels: `group 0: 34 %`. Masked pixels come last.
    pub fn of_labels(labels: &[u8]) -> Self {
        Self::of_painted_labels(labels, &Palette::default())
    }

    /// Works like [`Legend::of_labels`], for a picture with other colours.
    pub fn of_painted_labels(labels: &[u8], palette: &Palette) -> Self {
        let mut counts = [0_usize; 256];
        for &label in labels {
            counts[usize::from(label)] += 1;
        }
        let swatch = |(label, count): (u8, usize)| {
            let name = match label {
                MASKED_LABEL => "masked".into(),
                label => format!("group {label}"),
            };
            let text = format!("{name}: {}", percent(count as f64 / labels.len() as f64));
            Swatch { color: palette.color(label), text }
        };
        Self::Swatches((0..=255).zip(counts).filter(|&(_, count)| count > 0).map(swatch).collect())
    }

    /// The colour scale of [`colormap::paint_signed`], −`range` to `range`.
    pub fn signed(range: f64) -> Self {
        let colors = (-8..=8).map(|step| colormap::signed_color(f64::from(step) / 8.0)).collect();
        let end = brief(range);
        Self::Scale { colors, labels: vec![format!("\u{2212}{end}"), "0".into(), end], unit: String::new() }
    }

    /// The gray scale of [`develop`](crate::io::raster::develop), 0 to `white`.
    pub fn light(white: f64) -> Self {
        let gray = |step: i32| [raster::encode_srgb(step as f32 / 16.0); 3];
        let labels = vec!["0".into(), brief(white)];
        Self::Scale { colors: (0..=16).map(gray).collect(), labels, unit: String::new() }
    }

    /// The colour scale of [`colormap::paint_sequential`], `low` to `high`.
    pub fn sequential(low: f64, high: f64) -> Self {
        let colors = (0..=16).map(|step| colormap::sequential_color(f64::from(step) / 16.0)).collect();
        Self::Scale { colors, labels: vec![brief(low), brief(high)], unit: String::new() }
    }

    /// The scale with a unit. Legends other than scales are unchanged.
    #[must_use]
    pub fn with_unit(self, of: &str) -> Self {
        match self {
            Self::Scale { colors, labels, .. } => Self::Scale { colors, labels, unit: of.to_owned() },
            other => other,
        }
    }
}

/// A percentage such as `34 %`. It has more digits if rounding would hide a difference from 0 or 100 %.
fn percent(fraction: f64) -> String {
    match 100.0 * fraction {
        percent if (99.5..100.0).contains(&percent) => format!("{percent:.1}\u{202f}%"),
        percent if percent >= 1.0 => format!("{percent:.0}\u{202f}%"),
        percent if percent >= 0.01 => format!("{percent:.2}\u{202f}%"),
        _ => "<\u{202f}0.01\u{202f}%".into(),
    }
}

/// A number for a legend, with three significant digits.
pub(in crate::report) fn brief(value: f64) -> String {
    let text = match value.abs() {
        0.0 => "0".into(),
        size if (1e-3..1e4).contains(&size) => {
            let decimals = (2.0 - size.log10().floor()).clamp(0.0, 5.0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    };
    text.replace('-', "\u{2212}")
}
