//! A calibration's report as lines of text.

use super::report::{
    CalibrationReport, CameraFigures, MapBy, MapFigures, ProjectorFigures, StabilityFigures,
};
use crate::finding::decimal;
use crate::measure::Effort;

/// What a line is about, and its figures. The first is empty where the line continues the one before.
type Line = [String; 2];

impl CalibrationReport {
    /// The report as lines of text: what each line is about, and its figures. The first is empty where a line
    /// continues the one before.
    pub fn lines(&self) -> Vec<[String; 2]> {
        let mut lines = camera_lines(&self.camera);
        lines.extend(self.projector.iter().enumerate().map(projector_line));
        lines.extend(map_lines(&self.map));
        if let Some(evenness) = &self.evenness {
            lines.push(line(
                "evenness",
                format!("projector over camera: the least is {evenness} of the largest, by the symmetry of the light transport"),
            ));
        }
        lines.extend(stability_lines(&self.stability));
        lines.push(effort_line(&self.effort));
        lines
    }
}

fn line(about: &str, text: String) -> Line {
    [about.to_owned(), text]
}

fn percent(share: f64) -> f64 {
    100.0 * share
}

fn camera_lines(camera: &CameraFigures) -> Vec<Line> {
    let well = if camera.plateau_reached { "" } else { " at least: it was never full" };
    let response = if camera.linear { "linear" } else { "not linear, and corrected" };
    vec![
        line("camera", format!("black level {} DN, read noise {} DN", camera.black, camera.read_noise)),
        line(
            "",
            format!("gain {} electrons per DN, full well {} electrons{well}", camera.gain, camera.full_well),
        ),
        line(
            "",
            format!(
                "response {response} (it departs from a line by {:.2} % of the range beyond noise)",
                percent(camera.departure)
            ),
        ),
        line(
            "",
            format!(
                "{} DN/s without a pattern; white fills the range in {} s",
                camera.dark_rate,
                decimal(camera.exposure, 4)
            ),
        ),
    ]
}

fn projector_line((channel, projector): (usize, &ProjectorFigures)) -> Line {
    let text = format!(
        "channel {channel}: gamma {}, with a residual of {:.3} % of white; black and ambient {} % of white",
        projector.gamma,
        percent(projector.gamma_residual),
        projector.black.scaled(100.0)
    );
    line("projector", text)
}

fn map_lines(map: &MapFigures) -> Vec<Line> {
    let by = match map.by {
        MapBy::GrayCode => "Gray codes",
        MapBy::Checkerboard => "a checkerboard",
    };
    let kind = if map.lens.is_some() { "homography and lens" } else { "pixel by pixel: no common map fits" };
    vec![
        line("pixels", format!("by {by}, {} points, {kind}", map.points)),
        line(
            "",
            format!(
                "within {:.3} pixels of the projector (points scatter by {:.2}); {:.1} % unreliable, {:.1} % unseen",
                map.error,
                map.rms,
                percent(map.unreliable),
                percent(map.masked)
            ),
        ),
    ]
}

fn stability_lines(stability: &StabilityFigures) -> Vec<Line> {
    vec![
        line(
            "stability",
            format!(
                "light settles in {} s; drifts {} % per hour (watched for {:.0} s)",
                stability.settle,
                stability.drift_per_hour.scaled(100.0),
                stability.watched
            ),
        ),
        line("", format!("noise of one white photo {:.3} % a pixel", percent(stability.white_noise))),
    ]
}

fn effort_line(effort: &Effort) -> Line {
    let refused = effort.dropped + effort.repeated + effort.late;
    let text =
        format!("{} taken, {refused} refused, in {:.0} s of the rig's time", effort.taken, effort.seconds);
    line("frames", text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_all_three_kinds_are_refused() {
        let effort =
            Effort { taken: 70, dropped: 4, repeated: 2, late: 1, seconds: 12.4, ..Effort::default() };
        assert_eq!(effort_line(&effort)[1], "70 taken, 7 refused, in 12 s of the rig's time");
    }
}
