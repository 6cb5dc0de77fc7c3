//! The options that say how photos of a scene are computed, and where matrices are kept.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use crate::lab::{CacheChoice, OperatorChoice, Settings};
use crate::transport::Backend;

/// `--operator`, `--products` and `--memory`.
#[derive(Args)]
pub(super) struct OperatorArgs {
    /// How photos are computed: as products with a matrix, or each traced anew (the same photos, to rounding); auto decides by --memory
    #[arg(long, value_enum, default_value = "auto")]
    operator: OperatorArg,
    /// Where products with the matrix are computed (the same, to the rounding of sums); auto: on a GPU that has f64 and room for the matrix,
    /// else on the processor
    #[arg(long, value_enum, default_value = "auto")]
    products: ProductsArg,
    /// The memory that a matrix may take while it is assembled, e.g. 8GiB or 500MB [default: half of the machine's]
    #[arg(long, value_name = "BYTES")]
    memory: Option<Bytes>,
}

/// `--operator`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum OperatorArg {
    /// A matrix, unless it would exceed the memory
    Auto,
    /// Trace once, keep the matrix, multiply
    Replay,
    /// Trace for every photo, keep nothing
    Retrace,
}

impl From<OperatorArg> for OperatorChoice {
    fn from(argument: OperatorArg) -> Self {
        match argument {
            OperatorArg::Auto => Self::Auto,
            OperatorArg::Replay => Self::Replay,
            OperatorArg::Retrace => Self::Retrace,
        }
    }
}

/// `--products`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ProductsArg {
    /// On the device that traces, if that is a GPU with all that it takes
    Auto,
    /// On the processor
    Cpu,
    /// On the device that traces, whatever it is
    Device,
}

impl OperatorArgs {
    /// Puts the options into the settings of a laboratory.
    pub(super) fn put_into(&self, settings: &mut Settings) {
        settings.operator = self.operator.into();
        settings.backend = match self.products {
            ProductsArg::Auto => Backend::Auto,
            ProductsArg::Cpu => Backend::Cpu,
            ProductsArg::Device => Backend::Gpu,
        };
        settings.memory = self.memory.map(|Bytes(bytes)| bytes);
    }
}

/// `--cache` and `--no-cache`.
#[derive(Args, Default)]
pub(super) struct CacheArgs {
    /// Where matrices are kept for later runs [default: KRYLUX_CACHE, or krylux in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Neither look for a matrix nor keep one; so does an empty KRYLUX_CACHE
    #[arg(long, conflicts_with = "cache")]
    no_cache: bool,
}

impl CacheArgs {
    /// The cache to use.
    pub(super) fn choice(&self) -> CacheChoice {
        match &self.cache {
            _ if self.no_cache => CacheChoice::Off,
            Some(folder) => CacheChoice::Folder(folder.clone()),
            None => CacheChoice::Default,
        }
    }
}

/// A number of bytes: `8GiB`, `500MB`, `1.5G` or `1000`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Bytes(pub(super) u64);

impl FromStr for Bytes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unusable = || format!("`{text}` is no number of bytes; write 8GiB, 500MB or 1.5G");
        let split = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(split);
        let number: f64 = number.parse().map_err(|_| unusable())?;
        let unit = unit.trim().to_ascii_lowercase();
        let scale: u64 = match unit.as_str() {
            "" | "b" => 1,
            "k" | "kib" => 1 << 10,
            "m" | "mib" => 1 << 20,
            "g" | "gib" => 1 << 30,
            "t" | "tib" => 1 << 40,
            "kb" => 1_000,
            "mb" => 1_000_000,
            "gb" => 1_000_000_000,
            "tb" => 1_000_000_000_000,
            _ => return Err(unusable()),
        };
        let bytes = number * scale as f64;
        if bytes < 1.0 || bytes > (1_u64 << 60) as f64 {
            return Err(unusable());
        }
        Ok(Self(bytes as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_binary_or_decimal_units() {
        for (text, bytes) in [
            ("8GiB", 8 << 30),
            ("500MB", 500_000_000),
            ("1.5g", 3 << 29),
            ("16 KiB", 16384),
            ("1000", 1000),
            ("2tb", 2_000_000_000_000),
        ] {
            assert_eq!(text.parse(), Ok(Bytes(bytes)), "{text}");
        }
        for wrong in ["", "GiB", "-1", "8 apples", "1e3", "0", "1.2.3G", "99999999TiB"] {
            assert!(wrong.parse::<Bytes>().is_err(), "{wrong}");
        }
    }
}
