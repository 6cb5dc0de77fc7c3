//! The manifest `run.json`, which records how the results of a run were computed. It is written at the start and at the end of a run.

use std::ffi::OsStr;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::atomic;
use super::name::Name;
use crate::error::{Error, Result};
use crate::file;
use crate::finding::{Finding, Grade};

/// The version of the manifest's format.
pub const FORMAT: u32 = 1;

/// Everything on which a run depended, and its outcome. Fields that do not apply are absent.
///
/// `R` is the record of a run on a rig, [`RigRecord`](crate::measure::RigRecord).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "R: Serialize + DeserializeOwned")]
pub struct Manifest<R> {
    /// The version of the format, [`FORMAT`].
    pub krylux_format: u32,
    /// The program's version.
    pub version: String,
    /// The words of the command line.
    pub command: Vec<Name>,
    /// The fields of the verb's request with their values. Early records do not have them.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub request: Option<Value>,
    /// The state of the run.
    pub status: Status,
    /// The status as a sentence, such as `reached rtol` or the text of an error.
    pub message: String,
    /// The start time of the run, RFC 3339 in UTC.
    pub started: String,
    /// The seed of the random numbers for light paths and for starting vectors.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub seed: Option<u64>,
    /// The graphics adapter that traced the light paths.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub adapter: Option<Adapter>,
    /// The source of the photos: a scene, a rig or a matrix.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scene: Option<SourceFile>,
    /// The size of patterns and photos.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub resolution: Option<crate::image::Resolution>,
    /// The number of light paths per camera pixel.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub samples_per_pixel: Option<u32>,
    /// The maximum number of surface hits of a path.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub max_bounces: Option<u32>,
    /// `luma` or `rgb`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub channels: Option<String>,
    /// The estimated relative errors of the matrix.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub noise: Option<Noise>,
    /// The backend that computed the products with the matrix.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub products: Option<ProductsOn>,
    /// The cost of a run on a rig, and the way in which its photos were taken.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub rig: Option<R>,
    /// The comparison of the results with light from which they were not computed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub verification: Option<Verification>,
    /// Findings about the rig and the results. They determine the colour of the page and the exit status.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub findings: Vec<Finding>,
    /// The photo budget of the method. If the run is replayed with another analysis, that analysis may use this number of photos.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub photos_allowed: Option<usize>,
    /// The number of photos taken.
    pub photos: u64,
    /// The durations of the run's stages, in order.
    pub timings: Vec<Timing>,
    /// The files that were written, relative to the run's folder.
    pub outputs: Vec<String>,
    /// Folders inside the run's folder with the earlier runs that this run replaces. They are kept until this run is complete.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub replaces: Vec<String>,
}

/// The state of a run. The manifest of a killed run says `running`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The run has not ended.
    Running,
    /// The run is complete. The message says whether its result is good.
    Done,
    /// The user stopped the run. The results so far were written.
    Interrupted,
    /// An error stopped the run. The message is the error's text.
    Failed,
}

/// The backend of products with the matrix. The results of both backends differ only by the rounding of sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProductsOn {
    /// The CPU.
    Cpu,
    /// The graphics adapter.
    Device,
}

/// The relative errors of a traced matrix, estimated from two independent halves of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// The error of the whole matrix in the Frobenius norm.
    pub operator: f64,
    /// The error of the global light (two or more bounces) in the Frobenius norm.
    pub global: f64,
    /// The root-mean-square error of the photo under an all-ones pattern.
    pub white: f64,
}

/// The comparison of results with light from which they were not computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// The kind of the independent light.
    pub by: Independent,
    /// The light that the results predict, such as `photos of the eigenvectors`.
    pub of: String,
    /// The relative difference between predicted and independent photos, without the noise of the independent photos.
    pub error: f64,
    /// The relative noise of the independent photos.
    pub noise: f64,
    /// The verdict on the results. Early records do not have it.
    #[serde(default)]
    pub verdict: CheckVerdict,
    /// The part of the difference that the noise of both photos and the stated residuals do not explain, in standard errors of the
    /// difference. For several photos, it is the largest such part.
    #[serde(default)]
    pub statistic: f64,
    /// The probability of such a statistic if the results are right.
    #[serde(default)]
    pub p_value: f64,
    /// The relative error of the predicted photos for which the comparison would refute the results in 99 of 100 cases.
    #[serde(default)]
    pub resolution: f64,
    /// The probable cause of a refutation, if a number indicates it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub cause: Option<String>,
}

/// The verdict of a comparison with independent light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CheckVerdict {
    /// The results agree with the independent light within the stated noise, and the comparison would have detected wrong results.
    Passed,
    /// The results are wrong. If they were right, such a difference would have a probability of less than 0.001.
    Refuted,
    /// The noise of the comparison is too large to show whether the results are right.
    #[default]
    TooWeak,
}

impl Verification {
    /// The probability below which results are refuted.
    pub const LEVEL: f64 = 1e-3;

    /// The verdict for a p-value and a resolution. With a resolution of 1 or more, the comparison is too weak: it could not even refute
    /// results that are unrelated to the light, whose photos have a relative error of 1.
    pub fn judged(p_value: f64, resolution: f64) -> CheckVerdict {
        match p_value {
            // NaN also refutes the results.
            p if p < Self::LEVEL || p.is_nan() => CheckVerdict::Refuted,
            _ if resolution < 1.0 => CheckVerdict::Passed,
            _ => CheckVerdict::TooWeak,
        }
    }

    /// Whether the results have passed.
    pub fn is_passed(&self) -> bool {
        self.verdict == CheckVerdict::Passed
    }

    /// The verdict as a finding. The finding fails unless the comparison confirms the results.
    pub fn finding(&self) -> Finding {
        let grade = if self.is_passed() { Grade::Ok } else { Grade::Fails };
        let expected = format!("a chance of {} or more that a right answer is so far off", Self::LEVEL);
        let finding = Finding::graded("check", grade, self.sentence(), expected, "");
        finding.measured(self.p_value, 0.0, Self::LEVEL)
    }

    /// The verdict as a sentence without its full stop.
    pub fn sentence(&self) -> String {
        let [of, by] = [&self.of, &self.by.to_string()];
        let [error, noise] = [self.error, self.noise].map(|share| 100.0 * share);
        let cause = self.cause.as_deref().unwrap_or("the cause is not proven");
        match self.verdict {
            CheckVerdict::Passed => format!(
                "passed: {of} by {by}: {error:.1} % off, as noise and the stated residuals allow (noise of the check {noise:.1} %, p = {:.2}); errors from {:.1} % on would have been seen",
                self.p_value,
                100.0 * self.resolution
            ),
            CheckVerdict::Refuted if self.p_value >= Self::LEVEL => {
                format!("refuted: by {by}, the labels are not those of its light; {cause}")
            }
            CheckVerdict::Refuted => format!(
                "refuted: {of} by {by}: {error:.1} % off, {:.1} standard errors more than noise and the stated residuals allow (noise of the check {noise:.1} %, p = {:.0e}); {cause}",
                self.statistic, self.p_value
            ),
            CheckVerdict::TooWeak => format!(
                "not proven: {of} by {by}: noise ({noise:.1} %) and the residuals that the answer states hide errors of all of the light; give more photos, or more light or light paths"
            ),
        }
    }
}

/// Light from which results were not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Independent {
    /// Light paths of another seed.
    AnotherSeed,
    /// Another photo from the rig.
    AnotherPhoto,
}

impl std::fmt::Display for Independent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::AnotherSeed => "light paths of another seed",
            Self::AnotherPhoto => "one more photo",
        })
    }
}

/// A graphics adapter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Adapter {
    /// The name.
    pub name: String,
    /// The driver and its version.
    pub driver: String,
    /// The graphics interface, such as `vulkan`.
    pub backend: String,
}

/// The source of a run: a scene, a rig file or a matrix.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceFile {
    /// The path as given on the command line.
    pub path: Name,
    /// The hash of the file and of all files that it refers to, in hexadecimal.
    pub hash: String,
}

/// The duration of a stage of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// The stage's name.
    pub name: String,
    /// The wall-clock time in seconds.
    pub seconds: f64,
}

impl<R: Serialize + DeserializeOwned> Manifest<R> {
    /// The manifest of a run that starts now. `command` contains the words of the command line.
    pub fn new(command: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Self {
        Self {
            krylux_format: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            command: command.into_iter().map(|word| Name::from(word.as_ref())).collect(),
            request: None,
            status: Status::Running,
            message: "running".into(),
            started: rfc3339(SystemTime::now()),
            seed: None,
            adapter: None,
            scene: None,
            resolution: None,
            samples_per_pixel: None,
            max_bounces: None,
            channels: None,
            noise: None,
            products: None,
            rig: None,
            verification: None,
            findings: Vec::new(),
            photos_allowed: None,
            photos: 0,
            timings: Vec::new(),
            outputs: Vec::new(),
            replaces: Vec::new(),
        }
    }

    /// The words of the command line, joined into one line. Bytes that are not Unicode are replaced.
    pub fn command_line(&self) -> String {
        self.command.iter().map(Name::to_string).collect::<Vec<_>>().join(" ")
    }

    /// The verb of the command line. It is the first word after the program's name that is not an option.
    pub fn verb(&self) -> &str {
        let mut words = self.command.iter().skip(1).filter_map(Name::to_str);
        words.find(|word| !word.starts_with('-')).unwrap_or_default()
    }

    /// Appends the duration of a stage.
    pub fn record(&mut self, name: impl Into<String>, took: Duration) {
        self.timings.push(Timing { name: name.into(), seconds: took.as_secs_f64() });
    }

    /// Sets the outcome of the run. Afterwards, [`Manifest::write`] must be called.
    pub fn finish(&mut self, status: Status, message: impl Into<String>) {
        self.status = status;
        self.message = message.into();
    }

    /// Writes the manifest atomically. From then on, no link in its folder is followed; the same holds after [`Manifest::read`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text =
            serde_json::to_string_pretty(self).map_err(|error| Error::writing(path)(error.into()))?;
        text.push('\n');
        path.parent().into_iter().for_each(file::follow_no_links_below);
        atomic::write_bytes(path, text.as_bytes())
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Data`] if the file is not a manifest, or has another format version.
    pub fn read(path: &Path) -> Result<Self> {
        path.parent().into_iter().for_each(file::follow_no_links_below);
        let bytes = file::read(path)?;
        let unusable = |fault: String| Error::data(path, fault).help("give the run.json of a krylux run");
        let manifest: Self = serde_json::from_slice(&bytes).map_err(|error| unusable(error.to_string()))?;
        match manifest.krylux_format {
            FORMAT => Ok(manifest),
            other => Err(unusable(format!("its format is {other}, but this krylux reads format {FORMAT}"))),
        }
    }
}

/// The last second of the year 9999, in seconds since 1970. The year in RFC 3339 has four digits.
const LAST_SECOND: u64 = 253_402_300_799;

/// A time such as `2026-01-31T23:59:59Z`. Times before 1970 or after 9999 become the first or last second of this range.
pub fn rfc3339(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs().min(LAST_SECOND));
    humantime::format_rfc3339_seconds(UNIX_EPOCH + Duration::from_secs(seconds)).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verification_says_what_was_predicted_and_how_well() {
        let of = "photos of the eigenvectors".to_owned();
        let found = Verification {
            by: Independent::AnotherSeed,
            of,
            error: 0.023,
            noise: 0.0081,
            verdict: CheckVerdict::Passed,
            statistic: 0.5,
            p_value: 0.31,
            resolution: 0.0123,
            cause: None,
        };
        let said = "passed: photos of the eigenvectors by light paths of another seed: 2.3 % off, as noise and the stated residuals allow (noise of the check 0.8 %, p = 0.31)";
        assert!(found.sentence().starts_with(said), "{}", found.sentence());
        assert_eq!(found.by.to_string(), "light paths of another seed");
        assert_eq!(Independent::AnotherPhoto.to_string(), "one more photo");
        assert!(
            found.is_passed() && found.sentence().contains("errors from 1.2 % on"),
            "{}",
            found.sentence()
        );
        let refuted = Verification { verdict: CheckVerdict::Refuted, p_value: 2e-9, ..found };
        assert!(refuted.sentence().contains("the cause is not proven"), "{}", refuted.sentence());
        for (p, resolution, verdict) in [
            (0.5, 0.1, CheckVerdict::Passed),
            (0.5, 1.5, CheckVerdict::TooWeak),
            (0.5, f64::INFINITY, CheckVerdict::TooWeak),
            (0.5, f64::NAN, CheckVerdict::TooWeak),
            (1e-4, 1.5, CheckVerdict::Refuted),
            (f64::NAN, 0.1, CheckVerdict::Refuted),
        ] {
            assert_eq!(Verification::judged(p, resolution), verdict, "{p} {resolution}");
        }
        // An early record without a verdict counts as too weak.
        let earlier = r#"{"by": "another-photo", "of": "x", "error": 0.1, "noise": 0.1}"#;
        let earlier: Verification = serde_json::from_str(earlier).expect("it was written so");
        assert_eq!(earlier.verdict, CheckVerdict::TooWeak);
    }

    fn at(seconds: u64) -> String {
        rfc3339(UNIX_EPOCH + Duration::from_secs(seconds))
    }

    #[test]
    fn known_dates() {
        assert_eq!(at(0), "1970-01-01T00:00:00Z");
        assert_eq!(at(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(at(1_234_567_890), "2009-02-13T23:31:30Z");
        assert_eq!(at(4_107_542_399), "2100-02-28T23:59:59Z");
        assert_eq!(at(4_107_542_400), "2100-03-01T00:00:00Z");
    }

    #[test]
    fn times_without_a_four_digit_year_are_written_as_the_nearest_one() {
        assert_eq!(rfc3339(UNIX_EPOCH - Duration::from_secs(1)), "1970-01-01T00:00:00Z");
        assert_eq!(at(LAST_SECOND), "9999-12-31T23:59:59Z");
        assert_eq!(at(LAST_SECOND + 1), "9999-12-31T23:59:59Z");
    }
}
