//! The options that say where products come from: a matrix (fresh, or from the cache), or tracing anew.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use crate::cache::{self, Cache};
use crate::transport::Backend;

/// `--operator`, `--products` and `--memory`.
#[derive(Args)]
pub(super) struct OperatorArgs {
    /// Photos as products with a matrix, or each traced anew (the same photos, to rounding); auto decides by --memory
    #[arg(long, value_enum, default_value = "auto")]
    pub(super) operator: OperatorArg,
    /// Where products with the matrix are taken (the same, to the rounding of sums); auto: on a GPU that has f64 and room for the matrix,
    /// else on the processor
    #[arg(long, value_enum, default_value = "auto")]
    pub(super) products: ProductsArg,
    /// The memory that a matrix may take while it is made, e.g. 8GiB or 500MB [default: half of the machine's]
    #[arg(long, value_name = "BYTES")]
    memory: Option<Bytes>,
}

/// `--operator`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum OperatorArg {
    /// A matrix, unless it would not fit the memory
    Auto,
    /// Trace once, keep the matrix, multiply
    Replay,
    /// Trace for every photo, keep nothing
    Retrace,
}

/// `--products`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ProductsArg {
    /// On the device that traces, if that is a GPU with all that it takes
    Auto,
    /// On the processor
    Cpu,
    /// On the device that traces, whatever it is
    Device,
}

impl From<ProductsArg> for Backend {
    fn from(argument: ProductsArg) -> Self {
        match argument {
            ProductsArg::Auto => Self::Auto,
            ProductsArg::Cpu => Self::Cpu,
            ProductsArg::Device => Self::Gpu,
        }
    }
}

impl OperatorArgs {
    /// The first option given that is not what it is by itself.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [
            (self.operator != OperatorArg::Auto, "--operator"),
            (self.products != ProductsArg::Auto, "--products"),
            (self.memory.is_some(), "--memory"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
    }

    /// The limit in bytes.
    pub(super) fn memory(&self) -> u64 {
        self.memory.map_or_else(half_of_the_memory, |Bytes(bytes)| bytes)
    }
}

/// `--cache` and `--no-cache`.
#[derive(Args, Default)]
pub(super) struct CacheArgs {
    /// Where matrices are kept for later runs [default: KRYLUX_CACHE, or krylux in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub(super) cache: Option<PathBuf>,
    /// Neither look for a matrix nor keep one; so does an empty KRYLUX_CACHE
    #[arg(long, conflicts_with = "cache")]
    pub(super) no_cache: bool,
}

impl CacheArgs {
    /// The cache to use, if any.
    pub(super) fn open(&self) -> Option<Cache> {
        let folder = match (&self.cache, std::env::var_os("KRYLUX_CACHE")) {
            _ if self.no_cache => None,
            (Some(folder), _) => Some(folder.clone()),
            (None, Some(folder)) => {
                Some(PathBuf::from(folder)).filter(|folder| !folder.as_os_str().is_empty())
            }
            (None, None) => cache::default_folder(),
        };
        folder.map(|folder| Cache::new(folder, cache::LIMIT))
    }
}

/// A number of bytes: `8GiB`, `500MB`, `1.5G` or `1000`.
///
/// It is read here because a single letter is a power of 1024, as in other programs' memory limits; `parse-size` and `bytesize` take it
/// for a power of 1000.
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

/// `2.5 GiB`
pub(super) fn in_words(bytes: u64) -> String {
    let bytes = bytes as f64;
    let units = ["bytes", "KiB", "MiB", "GiB"];
    let power = ((bytes.max(1.0).log2() / 10.0) as usize).min(units.len() - 1);
    match power {
        0 => format!("{bytes} bytes"),
        _ => format!("{:.1} {}", bytes / 1024_f64.powi(power as i32), units[power]),
    }
}

/// Where the system does not tell, a machine is taken to have 8 GiB.
fn half_of_the_memory() -> u64 {
    let about = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let total = about.lines().find_map(|line| line.strip_prefix("MemTotal:"));
    let kibibytes = total.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok());
    kibibytes.map_or(4 << 30, |kibibytes| kibibytes * 512)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_units_of_either_kind() {
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

    #[test]
    fn bytes_are_said_in_the_largest_unit_that_they_fill() {
        assert_eq!([512, 2048, 5 << 29].map(in_words), ["512 bytes", "2.0 KiB", "2.5 GiB"]);
    }
}
