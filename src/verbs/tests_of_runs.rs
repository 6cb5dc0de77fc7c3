//! The predictions of a finished run about photos that it did not take.

use std::path::Path;

use crate::analysis::segment::segment;
use crate::analysis::{Cut, SegmentOptions};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::krylov::norm;
use crate::lab::{Lab, RunOptions};
use crate::measure::RigFile;
use crate::operator::product;
use crate::scene::builtin;
use crate::transport::Part;
use crate::verbs::options::LightPart;
use crate::verbs::{Audit, Eigs, Segment};

fn cornell() -> Result<Lab> {
    Lab::builder_of_scene(builtin::cornell().to_scene()).size(24, 24).samples(64).open()
}

/// A complete segmentation of `lab` by its global light, kept in a folder.
fn segmented(mut lab: Lab, folder: &Path) -> Result<Lab> {
    let options = RunOptions { folder: Some(folder.to_path_buf()), ..Default::default() };
    lab.begin_run("segment", &options)?;
    let found = lab.ask(&Segment { groups: vec![2], photos: Some(30), ..Segment::default() })?;
    lab.finish(&found)?;
    Ok(lab)
}

fn left(lab: &Lab) -> Result<Image> {
    let size = lab.projector_resolution();
    let lit = |pixel: usize| f64::from(u8::from(pixel % size.width < size.width / 2));
    Image::from_planes(size, &[(0..size.pixels()).map(lit).collect::<Vec<f64>>()])
}

/// The relative error of a run's photo against the true one, and the stated error.
fn errors(run: &mut Lab, truth: &Image, pattern: &Image) -> Result<[f64; 2]> {
    let (photo, stated) = run.photo_with_error(pattern)?;
    let truth = truth.plane(0);
    let off: Vec<f64> = photo.plane(0).iter().zip(&truth).map(|(a, b)| a - b).collect();
    let stated = stated.map_or(0.0, |stated| norm(&stated.plane(0)));
    Ok([norm(&off) / norm(&truth), stated / norm(&truth)])
}

#[test]
fn a_run_of_a_scene_answers_photos_eigenpairs_and_other_cuts_with_their_errors() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let run = folder.path().join("run");
    segmented(cornell()?, &run)?;
    // A new laboratory computes the truth, since the journal of the first one would keep the photo.
    let mut exact = cornell()?;
    let pattern = left(&exact)?;
    let truth = exact.photo(&pattern)?;
    let mut replay = crate::open(&run)?;
    let [off, stated] = errors(&mut replay, &truth, &pattern)?;
    assert!(off < 0.1 && off > 0.2 * stated && off < 4.0 * stated, "{off} {stated}");
    // The request is for eigenvectors of the global light itself.
    let asked = Eigs {
        count: 2,
        photos: Some(20),
        part: LightPart::Global,
        tolerance: Some(1e-8),
        ..Eigs::default()
    };
    let found = asked.pairs(&mut crate::open(&run)?)?.found;
    let known = asked.pairs(&mut exact)?.found;
    // The bound is wide, because the 30 photos of the run were taken for the normalized cut.
    assert!((found.values[0] / known.values[0] - 1.0).abs() < 0.05, "{:?} {:?}", found.values, known.values);
    let off = (found.values[0] - known.values[0]).abs();
    assert!(off <= found.bounds[0] && found.standard_errors[0] > 0.0, "{off} {:?}", found.bounds);
    let average = SegmentOptions { cut: Cut::Average, photos: 20, ..SegmentOptions::groups([2]) };
    assert!(segment(&mut crate::open(&run)?.operator(Part::Global)?, &average).is_ok());
    Ok(())
}

/// A panic while a run replaces another run unwinds through the laboratory.
#[test]
#[allow(clippy::panic, reason = "the test is about a panic")]
fn a_panic_before_the_first_photo_gives_the_folder_back() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let run = folder.path().join("run");
    segmented(cornell()?, &run)?;
    let content = || {
        let names = std::fs::read_dir(&run).expect("it is there").flatten().map(|entry| entry.path());
        let mut files: Vec<_> = names.map(|path| (path.clone(), std::fs::read(path).ok())).collect();
        files.sort();
        files
    };
    let before = content();
    let options = RunOptions { folder: Some(run.clone()), overwrite: true, resume: false };
    let mut lab = cornell()?;
    let panicked = crate::machine::unless_panics(move || -> () {
        lab.begin_run("segment", &options).expect("the folder is writable");
        panic!("a fault of the program");
    });
    assert!(panicked.is_none());
    assert_eq!(content(), before);
    Ok(())
}

#[test]
fn what_was_photographed_is_answered_as_it_was_and_an_audit_wants_real_photos() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let run = folder.path().join("run");
    let mut exact = segmented(cornell()?, &run)?;
    let ones = vec![1.0; exact.resolution().pixels()];
    let white = product(&mut exact.operator(Part::Global)?, &ones)?;
    let mut replay = crate::open(&run)?;
    let mut operator = replay.operator(Part::Global)?;
    assert_eq!(product(&mut operator, &ones)?, white);
    // The model predicts the same photo for the same pattern, up to rounding.
    product(&mut operator, &left(&exact)?.plane(0))?;
    let again = product(&mut operator, &ones)?;
    let off: Vec<f64> = again.iter().zip(&white).map(|(a, b)| a - b).collect();
    assert!(norm(&off) < 1e-9 * norm(&white), "{}", norm(&off));
    let refused = crate::open(&run)?.ask(&Audit::default());
    assert!(matches!(refused, Err(Error::Data { .. })), "a model would be symmetric by construction");
    Ok(())
}

#[test]
fn a_run_of_a_rig_answers_other_patterns() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let run = folder.path().join("run");
    let ideal = || RigFile::load("assets/rigs/ideal.toml".as_ref());
    let mut exact = cornell()?.through_rig(ideal()?)?;
    let rig = cornell()?.through_rig(ideal()?)?;
    segmented(rig, &run)?;
    let pattern = left(&exact)?;
    let truth = exact.photo(&pattern)?;
    let mut replay = crate::open(&run)?;
    let [off, stated] = errors(&mut replay, &truth, &pattern)?;
    assert!(off < 0.15 && off < 4.0 * stated, "{off} {stated}");
    Ok(())
}

/// Earlier versions of the program measured direct light by squares of two pixels instead of codes.
#[test]
fn a_run_whose_direct_light_was_measured_by_squares_can_still_be_asked() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let run = folder.path().join("run");
    let text = include_str!("../../assets/rigs/realistic.toml")
        .replace("size = [160, 160]", "size = [60, 60]")
        .replace("black_takes = 16", "black_takes = 16\ndirect_square = 2");
    let file = folder.path().join("rig.toml");
    std::fs::write(&file, text).map_err(Error::writing(&file))?;
    let mut rig = cornell()?.through_rig(RigFile::load(&file)?)?;
    rig.calibrate(&Default::default())?;
    let options = RunOptions { folder: Some(run.clone()), ..Default::default() };
    rig.begin_run("segment", &options)?;
    let found = rig.ask(&Segment { groups: vec![2], photos: Some(12), ..Segment::default() })?;
    rig.finish(&found)?;
    let pattern = left(&rig)?.plane(0);
    let direct = |lab: &mut Lab| product(&mut lab.operator(Part::Direct)?, &pattern);
    let expected = direct(&mut crate::open(&run)?)?;
    let record = run.join("run.json");
    let text = std::fs::read_to_string(&record).map_err(Error::reading(&record))?;
    assert!(text.contains("\"direct_square\": 2"), "{text}");
    let unset = text.replace("\"direct_square\": 2", "\"direct_square\": null");
    std::fs::write(&record, unset).map_err(Error::writing(&record))?;
    assert_eq!(direct(&mut crate::open(&run)?)?, expected);
    Ok(())
}
