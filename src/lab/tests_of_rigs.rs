//! Measurements of a realistic rig, compared with the true light transport of the scene in front of it.

use std::path::Path;

use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, adjusted_rand_index};
use crate::bench::audit::{AuditOptions, audit};
use crate::error::Result;
use crate::finding::Grade;
use crate::image::Image;
use crate::krylov::norm;
use crate::lab::Lab;
use crate::measure::RigFile;
use crate::operator::Operator;
use crate::scene::{Scene, builtin};
use crate::transport::Part;

const REALISTIC: &str = include_str!("../../assets/rigs/realistic.toml");

fn traced(scene: Scene, side: usize) -> Result<Lab> {
    // The seed of the light paths differs from the seed in the shipped rig files.
    Lab::builder_of_scene(scene).size(side, side).samples(64).seed(9).open()
}

/// The uncalibrated realistic rig in front of a scene. Along each side, its camera has `finer` times as many pixels as the scene. In the
/// rig file, the first text of each pair in `replaced` is replaced by the second.
fn before(exact: &Lab, finer: f64, replaced: &[[&str; 2]]) -> Result<Lab> {
    let side = (finer * exact.resolution().width as f64).round();
    let mut text = REALISTIC.replace("size = [160, 160]", &format!("size = [{side}, {side}]"));
    for [from, to] in replaced {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    exact.through_rig(RigFile::from_bytes(Path::new("assets/rigs/realistic.toml"), text.as_bytes())?)
}

fn white(lab: &mut Lab, part: Part) -> Result<Vec<f64>> {
    Ok(lab.white_of(part)?.swap_remove(0))
}

/// The relative error of the rig's photo of one part under white. The ratio of the two full white photos converts the rig's unit.
fn error(rig: &mut Lab, exact: &mut Lab, part: Part) -> Result<f64> {
    let unit = white(rig, Part::Full)?.iter().sum::<f64>() / white(exact, Part::Full)?.iter().sum::<f64>();
    let (found, truth) = (white(rig, part)?, white(exact, part)?);
    let misfit: Vec<f64> = found.iter().zip(&truth).map(|(found, truth)| found / unit - truth).collect();
    Ok(norm(&misfit) / norm(&truth))
}

#[test]
fn a_sheet_tells_the_vignetting_of_both_devices() -> Result<()> {
    let mut exact = traced(builtin::corner().to_scene(), 32)?;
    let mut rig = before(&exact, 2.5, &[])?;
    assert!(rig.measure_flat_field().is_err(), "a rig that was not calibrated");
    let report = rig.calibrate(&Default::default())?;
    // The corners of the projector have 0.9 of the light at its centre. For the camera, this factor is 0.85. The ratio is 0.944.
    let ratio = report.evenness.map_or(f64::NAN, |evenness| evenness.value);
    assert!((ratio - 0.944).abs() < 0.03, "{ratio}");
    let lines = report.lines();
    for (about, text) in
        [("projector", "channel 0: gamma 2."), ("pixels", "by Gray codes"), ("evenness", "0.9")]
    {
        let has = |line: &[String; 2]| line[0] == about && line[1].contains(text);
        assert!(lines.iter().any(has), "{about}: {lines:?}");
    }
    let uneven = error(&mut rig, &mut exact, Part::Full)?;
    let flat = rig.measure_flat_field()?;
    let corner = |values: &[f64]| values[0] / values.iter().copied().fold(0.0, f64::max);
    // The centre of the corner pixel is half a pixel from the corner, where the vignetting is slightly weaker.
    assert!((corner(&flat.projector) - 0.905).abs() < 0.02, "{}", corner(&flat.projector));
    assert!((corner(&flat.camera) - 0.857).abs() < 0.02, "{}", corner(&flat.camera));
    let even = error(&mut rig, &mut exact, Part::Full)?;
    // The noise of one white photo is 0.5 % per pixel.
    assert!(uneven > 0.03 && even < 0.012, "{uneven} {even}");
    Ok(())
}

/// The corners of the projector have 0.9 of the light at its centre. For the camera, this factor is 0.85. If either factor were ignored,
/// the error would be a tenth.
#[test]
fn white_and_direct_light_are_those_of_even_devices() -> Result<()> {
    let exact = traced(builtin::zigzag().to_scene(), 24)?;
    let mut rig = before(&exact, 2.5, &[])?;
    rig.calibrate(&Default::default())?;
    rig.measure_flat_field()?;
    let ones = Image::filled(rig.projector_resolution(), 1, 1.0);
    let off = |found: &Image, expected: &Image| {
        let (found, expected) = (found.plane(0), expected.plane(0));
        let misfit: Vec<f64> =
            found.iter().zip(&expected).map(|(found, expected)| found - expected).collect();
        norm(&misfit) / norm(&expected)
    };
    // Every pattern, even the pattern of ones, is dimmed at pixels where the projector is brighter.
    let (white, photo) = (rig.white()?, rig.photo(&ones)?);
    assert!(off(&white, &photo) < 0.01, "{}", off(&white, &photo));
    // The direct light under ones equals the row sums of the direct light's matrix.
    let sums = rig.with_measurement(|measurement| {
        let direct = measurement.direct()?;
        let rows = measurement.direct_rows(0)?;
        Ok((direct, rows.iter().map(|row| row.iter().map(|entry| entry.1).sum()).collect::<Vec<f64>>()))
    })?;
    let Some((direct, sums)) = sums else { unreachable!("a rig") };
    let misfit: Vec<f64> =
        sums.iter().zip(&direct.planes[0].values).map(|(sum, light)| sum - light).collect();
    assert!(
        norm(&misfit) < 0.01 * norm(&direct.planes[0].values),
        "{}",
        norm(&misfit) / norm(&direct.planes[0].values)
    );
    Ok(())
}

#[test]
fn direct_light_that_lens_and_camera_spread_is_no_global_light() -> Result<()> {
    let mut exact = traced(builtin::corner().to_scene(), 48)?;
    let blurred = ["blur = 0.2", "blur = 0.6"];
    // The fine camera measures direct light with codes, which show the blur. Its measured error is 0.083. Checkerboards with squares of two
    // pixels hide the blur and gave 0.13. The noise of the direct light alone is 0.07 of the global light. The coarse camera does not
    // resolve codes, so its limit is larger.
    for (finer, most) in [(2.5, 0.10), (1.0, 0.35)] {
        let mut rig = before(&exact, finer, &[blurred])?;
        rig.calibrate(&Default::default())?;
        rig.measure_flat_field()?;
        let global = error(&mut rig, &mut exact, Part::Global)?;
        // A diagonal model of the direct light left an error of 1.8 here.
        assert!(global < most, "{global} with {finer} camera pixels for each of the projector's");
    }
    Ok(())
}

#[test]
fn a_camera_as_coarse_as_the_projector_is_registered_to_a_part_of_a_pixel() -> Result<()> {
    let mut exact = traced(builtin::corner().to_scene(), 48)?;
    let even = [["vignetting = 0.1 ", "vignetting = 0.0 "], ["vignetting = 0.15", "vignetting = 0.0"]];
    let mut rig = before(&exact, 1.0, &even)?;
    let report = rig.calibrate(&Default::default())?;
    let lens = report.map.lens.ok_or(crate::Error::Interrupted)?;
    let [x, y] = lens.to_projector([24.0, 24.0]);
    assert!((x - 24.3).abs() < 0.03 && (y - 24.4).abs() < 0.03, "{x} {y}");
    let white = error(&mut rig, &mut exact, Part::Full)?;
    // The remaining error is noise. A pixel map from Gray codes gave an error of 0.1, as of a camera that sees only the lit area.
    assert!(white < 0.06, "{white}");
    Ok(())
}

#[test]
fn a_rig_is_calibrated_in_a_lit_room() -> Result<()> {
    let exact = traced(builtin::corner().to_scene(), 24)?;
    let mut rig = before(&exact, 2.5, &[["level = 0.1 ", "level = 0.3 "]])?;
    let report = rig.calibrate(&Default::default())?;
    let gamma = report.projector[0].gamma.value;
    assert!((gamma - 2.2).abs() < 0.002, "{gamma}");
    Ok(())
}

#[test]
fn a_rig_whose_light_is_not_in_proportion_is_refused_until_it_is_calibrated() -> Result<()> {
    let exact = traced(builtin::corner().to_scene(), 24)?;
    let refused = before(&exact, 2.5, &[])?.white().map_or_else(|error| error.to_string(), |_| String::new());
    assert!(refused.contains("was not calibrated") && refused.contains("rig calibrate"), "{refused}");
    let meant = ["black_takes = 16", "black_takes = 16\nresponse = false"];
    assert!(before(&exact, 2.5, &[meant])?.white().is_ok(), "the file says that counts are used as they are");
    let mut rig = before(&exact, 2.5, &[])?;
    rig.unexamined();
    let report = rig.with_measurement(|measurement| audit(measurement, &AuditOptions::default()))?;
    let Some(report) = report else { unreachable!("a rig") };
    assert!(report.checks.iter().any(|check| check.grade == Grade::Fails), "an audit finds it");
    let mut rig = before(&exact, 2.5, &[])?;
    rig.calibrate(&Default::default())?;
    assert!(rig.white().is_ok());
    let linear = ["gamma = 2.2", "gamma = 1.0"];
    assert!(before(&exact, 2.5, &[linear])?.white().is_ok(), "in proportion without a calibration");
    Ok(())
}

/// The camera is aligned with the projector, and has 2 or 2.5 pixels per projector pixel along each side. At the border of the lit area, a
/// camera pixel of the calibrated rig sees a little of an unlit projector pixel, and one of the ideal rig sees half of a neighbour. These
/// camera pixels once reduced the adjusted Rand index to between 0.0 and 0.23.
#[test]
fn an_aligned_camera_finds_the_groups_at_silhouettes_too() -> Result<()> {
    let exact = traced(builtin::zigzag().to_scene(), 24)?;
    let aligned = [
        ["shift = [0.3, 0.4]", "shift = [0.0, 0.0]"],
        ["rotation = 0.1", "rotation = 0.0"],
        ["scale = 1.002", "scale = 1.0"],
        ["distortion = 0.002", "distortion = 0.0"],
    ];
    let ideal = |finer: f64| {
        let text = include_str!("../../assets/rigs/ideal.toml");
        let side = (finer * 24.0).round();
        let text = text.replace("[camera] ", &format!("[camera]\nsize = [{side}, {side}]\n"));
        exact.through_rig(RigFile::from_bytes(Path::new("assets/rigs/ideal.toml"), text.as_bytes())?)
    };
    for finer in [2.0, 2.5] {
        let mut calibrated = before(&exact, finer, &aligned)?;
        calibrated.calibrate(&Default::default())?;
        for (name, mut rig) in [("calibrated", calibrated), ("ideal", ideal(finer)?)] {
            let resolution = Some(exact.resolution());
            let options = SegmentOptions { photos: 40, resolution, ..SegmentOptions::groups([2]) };
            let found = segment(&mut rig.operator(Part::Global)?, &options)?;
            let score = adjusted_rand_index(&found.labels[0].1, &exact.labels()?)?;
            assert!(score >= 0.99, "{name} {finer}: {score}");
        }
    }
    Ok(())
}

#[test]
fn noise_of_a_twelfth_of_the_light_does_not_ruin_a_segmentation() -> Result<()> {
    let exact = traced(builtin::two_sheets().to_scene(), 64)?;
    let mut rig = before(&exact, 2.5, &[["full_well = 60000", "full_well = 5000"]])?;
    rig.calibrate(&Default::default())?;
    rig.measure_flat_field()?;
    let resolution = Some(exact.resolution());
    let options = SegmentOptions { photos: 40, resolution, ..SegmentOptions::default() };
    let mut global = rig.operator(Part::Global)?;
    let found = segment(&mut global, &options)?;
    assert!(global.standard_error() > 0.0);
    let score = adjusted_rand_index(&found.labels[0].1, &exact.labels()?)?;
    // Without the low-pass filter, the eigenvectors were noise, and the score was between 0 and 0.4.
    assert!(score > 0.98 && found.regions.count == 2, "{score} {:?}", found.regions);
    Ok(())
}
