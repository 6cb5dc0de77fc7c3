//! Pictures and plot of a compensation.

use super::contest::{Entry, TargetLight, clamped, over_frames};
use super::figure::{Content, Panel, Plot};
use super::stage::Stage;
use crate::report::plot::{LinePlot, Series};

pub(super) fn percent(share: f64) -> f64 {
    100.0 * share
}

/// Panels of target, photos with and without compensation, projected pattern, and errors; all photos share one exposure.
pub(super) fn panels(stage: &Stage, target_light: &TargetLight, plain: &[f64], best: &Entry) -> Vec<Panel> {
    let light = |values: Vec<f64>| Content::Light { values, white: Some(target_light.peak) };
    let pattern = clamped(&best.pattern);
    let [seen, before] = [stage.photo(&pattern), stage.photo(plain)];
    let error =
        |photo: &[f64]| -> Vec<f64> { photo.iter().zip(&target_light.light).map(|(y, b)| y - b).collect() };
    let residual =
        |pattern: &[f64]| format!("residual {:.2} %", percent(target_light.residual(stage, pattern)));
    vec![
        stage.panel("target", "The target, W/(m² sr)", light(target_light.light.clone())),
        stage.panel("before", format!("Projected as it is: {}", residual(plain)), light(before.clone())),
        stage.panel("after", format!("Compensated: {}", residual(&pattern)), light(seen.clone())),
        stage.panel(
            "pattern",
            "What is projected, 0 to 1",
            Content::Light { values: pattern, white: Some(1.0) },
        ),
        stage.panel(
            "error-before",
            "Projected as it is less the target, W/(m² sr)",
            Content::Signed(error(&before)),
        ),
        stage.panel("error-after", "Compensated less the target, W/(m² sr)", Content::Signed(error(&seen))),
    ]
}

/// Displayed residuals at equal photo counts and, through a rig, at equal frames.
pub(super) fn at_equal_costs(
    lines: Vec<Series>,
    entries: &[(&str, &Entry)],
    uncompensated: f64,
    optimum: f64,
) -> Vec<Plot> {
    let mut plots = vec![residuals(lines, uncompensated, optimum)];
    let over_frames = over_frames(entries);
    if !over_frames.is_empty() {
        let mut plot = residuals(over_frames, uncompensated, optimum);
        plot.caption = "The same, displayed, at equal frames: what the camera takes for each method. A photo of a signed pattern is that of \
                        two, and every pattern has its takes and exposures; sentinels are among them. Black, white and the choice of exposures \
                        are common to all methods and not counted."
            .into();
        plot.lines.x_label = "frames".into();
        plots.push(plot);
    }
    plots
}

/// Residuals at equal photo counts, with marks for no compensation and for the optimal pattern.
fn residuals(lines: Vec<Series>, uncompensated: f64, optimum: f64) -> Plot {
    Plot {
        caption: "Relative residual by the light itself, at equal photos (the white one not counted).".into(),
        lines: LinePlot {
            x_label: "photos".into(),
            y_label: "relative residual".into(),
            logarithmic: true,
            series: lines,
            marks: vec![(uncompensated, "uncompensated".into()), (optimum, "best inside the box".into())],
        },
    }
}
