//! Tests that answers are verified by light from photos or paths that the answers did not use.

use crate::analysis::compensate::compensate;
use crate::analysis::segment::{Cut, segment};
use crate::analysis::{CompensateOptions, Compensation, SegmentOptions, Target};
use crate::error::{Error, Result};
use crate::finding::Grade;
use crate::image::Image;
use crate::io::manifest::{CheckVerdict, Independent, Verification};
use crate::lab::{Answer, Lab, RunOptions};
use crate::measure::RigFile;
use crate::scene::builtin;
use crate::transport::Part;
use crate::verbs::options::LightPart;
use crate::verbs::{Eigs, Segment};

fn zigzag() -> Result<Lab> {
    Lab::builder_of_scene(builtin::zigzag().to_scene()).size(24, 24).samples(16).open()
}

fn pairs() -> Eigs {
    Eigs { count: 3, photos: Some(20), part: LightPart::Global, tolerance: Some(1e-8), ..Eigs::default() }
}

#[test]
fn eigenpairs_of_a_scene_are_checked_by_another_seed_and_the_record_says_so() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let run = folder.path().join("run");
    let mut lab = zigzag()?;
    lab.begin_run("eigs", &RunOptions { folder: Some(run.clone()), ..RunOptions::default() })?;
    let answer = pairs().pairs(&mut lab)?;
    let found = &answer.found;
    let photos = lab.contact_sheet().len();
    let Some(checked) = lab.verify_eigenpairs(Part::Global, found)? else { unreachable!("a scene") };
    assert_eq!((checked.verification.by, checked.estimates.len()), (Independent::AnotherSeed, 3));
    assert_eq!(lab.contact_sheet().len(), photos, "no photo of the run");
    for (estimate, theta) in checked.estimates.iter().zip(&found.values) {
        // The stated eigenvalues are too large, because the eigenvectors also fit the noise of 16 samples.
        assert!(estimate.quotient[0] < *theta && estimate.value < *theta, "{estimate:?} {theta}");
        assert!(estimate.error_of(*theta) >= estimate.standard_error && estimate.standard_error > 0.0);
    }
    assert!(checked.verification.error > 0.01 && checked.verification.noise > 0.01);
    lab.finish(&answer)?;
    let record = std::fs::read_to_string(run.join("run.json")).map_err(Error::reading(&run))?;
    assert!(record.contains("\"another-seed\""), "{record}");
    let page = std::fs::read_to_string(run.join("report.html")).map_err(Error::reading(&run))?;
    assert!(page.contains("Checked by light paths of another seed"));
    Ok(())
}

#[test]
fn a_matrix_has_no_other_light() -> Result<()> {
    let matrix = crate::sparse::Csr::new(2, vec![0, 1, 2], vec![0, 1], vec![2.0, 1.0])?;
    let mut lab = Lab::builder_of_matrix(matrix, "two").open().expect("a matrix can be opened");
    let asked = Eigs { count: 1, photos: Some(2), part: LightPart::Full, ..pairs() };
    let found = asked.pairs(&mut lab)?.found;
    assert_eq!(lab.verify_eigenpairs(Part::Full, &found)?, None);
    Ok(())
}

#[test]
fn a_rig_is_checked_by_one_more_photo_of_each_answer() -> Result<()> {
    let mut rig = zigzag()?.through_rig(RigFile::load("assets/rigs/ideal.toml".as_ref())?)?;
    // With so few photos, the residuals exceed the shot noise that an uncalibrated rig is assumed to have.
    let asked = Eigs { photos: Some(6), part: LightPart::Full, ..pairs() };
    let found = asked.pairs(&mut rig)?.found;
    let photos = rig.contact_sheet().len();
    let Some(checked) = rig.verify_eigenpairs(Part::Full, &found)? else { unreachable!("a rig") };
    assert_eq!(rig.contact_sheet().len(), photos + 1);
    assert_eq!((checked.verification.by, checked.estimates.len()), (Independent::AnotherPhoto, 0));
    assert_eq!(checked.verification.verdict, CheckVerdict::Passed, "within the residuals that it states");
    // The photo shows a sum of orthogonal eigenvectors with random signs. All of their residuals are parallel to the next Lanczos vector,
    // so they add up or cancel. The only noise of the devices is the rounding to 12 and 16 bits. The error and the assumed noise together
    // thus equal the whole difference.
    let size = found.values.iter().map(|value| value * value).sum::<f64>().sqrt();
    let share = |residual: f64| residual.abs() / size.hypot(residual);
    let [first, second, third] = [0, 1, 2].map(|at| found.residuals[at]);
    let sums =
        [first + second + third, first + second - third, first - second + third, first - second - third];
    let difference = |verification: &Verification| verification.error.hypot(verification.noise);
    let seen = difference(&checked.verification);
    assert!(checked.verification.error > 0.0, "{:?}", checked.verification);
    assert!(sums.iter().any(|&sum| (share(sum) - seen).abs() < 1e-3), "{seen} {:?}", sums.map(share));
    // Eigenvalues that are a fifth too large are detected. The difference grows by a fifth of the part of the photo without residuals.
    let mut wrong = found.clone();
    wrong.values.iter_mut().for_each(|value| *value *= 1.2);
    let Some(checked) = rig.verify_eigenpairs(Part::Full, &wrong)? else { unreachable!("a rig") };
    let expected = (0.2 * (1.0 - seen * seen).sqrt()).hypot(seen);
    let seen = difference(&checked.verification);
    assert!((seen - expected).abs() < 1e-3, "{seen} {expected}");
    assert_eq!(checked.verification.verdict, CheckVerdict::Refuted);
    Ok(())
}

fn segmented(lab: &mut Lab, options: SegmentOptions) -> Result<crate::analysis::Segmentation> {
    let options = SegmentOptions { resolution: Some(lab.resolution()), ..options };
    segment(&mut lab.operator(Part::Global)?, &options)
}

#[test]
fn a_segmentation_is_checked_pair_by_pair() -> Result<()> {
    let mut lab = zigzag()?;
    let options = SegmentOptions { photos: 24, ..SegmentOptions::groups([2]) };
    let found = segmented(&mut lab, options)?;
    let checked = lab.verify_segmentation(Part::Global, Cut::Normalized, &found)?;
    let Some(checked) = checked else { unreachable!("a scene") };
    assert_eq!(checked.estimates.len(), found.eigenvalues.len() - 1);
    let second = &checked.estimates[0];
    // Two sheets do not exchange light, so the eigenvalue is 1.
    assert!((second.value - 1.0).abs() < 3.0 * second.standard_error + 0.01, "{second:?}");
    assert_eq!(checked.refuted(2), 0, "{:?}", checked.estimates);
    assert_eq!(lab.verify_segmentation(Part::Global, Cut::Average, &found)?, None);
    Ok(())
}

/// The compensation for a dark gray target, with six photos.
fn compensated(lab: &mut Lab) -> Result<Compensation> {
    let target = Target::new(&Image::filled(lab.resolution(), 1, 0.3), &lab.ambient()?)?;
    let options =
        CompensateOptions { photos: 6, baseline: lab.is_simulated()?, ..CompensateOptions::default() };
    let mut channels = lab.operators(Part::Full)?;
    lab.photos(|_| compensate(&mut channels, &target, &options))
}

/// The root mean square deviation of a compensated photo from the photo of `exact`, in stated standard errors.
fn deviation(lab: &mut Lab, exact: &mut Lab) -> Result<f64> {
    let white = Image::filled(lab.projector_resolution(), 1, 1.0);
    let found = compensated(lab)?;
    let Some([photo, errors]) = lab.verify_compensation(&found)?.and_then(|checked| checked.photo) else {
        unreachable!("there is other light")
    };
    // A rig and a scene have different units, so the ratio of their photos is needed.
    let [seen, known] =
        [&mut *lab, &mut *exact].map(|lab| lab.single_photo(&white).map(|photo| photo.photo.plane(0)));
    let unit = seen?.iter().sum::<f64>() / known?.iter().sum::<f64>();
    let truth = exact.single_photo(&found.pattern)?.photo.plane(0);
    let (photo, errors) = (photo.plane(0), errors.plane(0));
    let ambient = lab.ambient()?.plane(0);
    let z = |at: usize| (photo[at] - ambient[at] - unit * truth[at]) / errors[at];
    let squares: Vec<f64> = (0..photo.len()).filter(|&at| errors[at] > 0.0).map(|at| z(at).powi(2)).collect();
    Ok((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

#[test]
fn a_compensated_photo_states_the_error_of_each_pixel() -> Result<()> {
    let scene = || Lab::builder_of_scene(builtin::zigzag().to_scene()).size(24, 24);
    let mut exact = scene().samples(4096).seed(11).open()?;
    let of_scene = deviation(&mut zigzag()?, &mut exact)?;
    // The error of each pixel is a single random draw, and these draws are pooled. The mean square is therefore off by some percent.
    assert!((0.8..1.3).contains(&of_scene), "{of_scene}");
    let mut behind = scene().samples(64).seed(7).open()?;
    let text =
        include_str!("../../assets/rigs/realistic.toml").replace("size = [160, 160]", "size = [60, 60]");
    let file = RigFile::from_bytes("assets/rigs/realistic.toml".as_ref(), text.as_bytes())?;
    let mut rig = behind.through_rig(file)?;
    rig.calibrate(&Default::default())?;
    rig.measure_flat_field()?;
    let of_rig = deviation(&mut rig, &mut behind)?;
    // Noise and the remaining error of the calibration contribute to the deviation. Over many repeats its value is 1.1 to 1.2.
    assert!((0.8..1.4).contains(&of_rig), "{of_rig}");
    Ok(())
}

/// Verdicts on correct answers and on wrong answers, for one seed of the light paths. The wrong answers are shuffled labels, an
/// eigenvector with added noise of twice the run's noise, and a pattern that compensates another scene.
fn verdicts(seed: u32) -> Result<([CheckVerdict; 3], [CheckVerdict; 3])> {
    let lab =
        |scene: crate::scene::Scene| Lab::builder_of_scene(scene).size(24, 24).samples(32).seed(seed).open();
    let mut zigzag = lab(builtin::zigzag().to_scene())?;
    let found = pairs().pairs(&mut zigzag)?.found;
    let of_pairs = |lab: &mut Lab, found: &crate::krylov::Eigs| {
        lab.verify_eigenpairs(Part::Global, found).map(|of| of.map(|of| of.verification))
    };
    let right_pairs = of_pairs(&mut zigzag, &found)?;
    let noise = right_pairs.as_ref().map_or(f64::NAN, |of| of.noise);
    let mut noisy = found.clone();
    let vector = &mut noisy.vectors[seed as usize % 3];
    let random = crate::krylov::Start::Gaussian { seed: seed.into() }.vector(vector.len());
    let length = crate::krylov::norm(&random);
    vector.iter_mut().zip(&random).for_each(|(u, r)| *u += 2.0 * noise * r / length);
    let length = crate::krylov::norm(vector);
    vector.iter_mut().for_each(|u| *u /= length);
    let wrong_pairs = of_pairs(&mut zigzag, &noisy)?;
    let options = SegmentOptions { photos: 24, seed: seed.into(), ..SegmentOptions::groups([2]) };
    let mut groups = segmented(&mut zigzag, options)?;
    let of_groups = |lab: &mut Lab, found: &crate::analysis::Segmentation| {
        lab.verify_segmentation(Part::Global, Cut::Normalized, found)
    };
    let right_groups = of_groups(&mut zigzag, &groups)?;
    assert!(right_groups.as_ref().is_some_and(|of| of.supported[0].1 > 0.9), "{right_groups:?}");
    let labels = &mut groups.labels[0].1;
    let order = crate::krylov::Start::Gaussian { seed: u64::from(seed) + 1 }.vector(labels.len());
    let mut seen: Vec<usize> = (0..labels.len()).filter(|&at| !groups.mask[at]).collect();
    let before = labels.clone();
    let places = seen.clone();
    seen.sort_by(|a, b| order[*a].total_cmp(&order[*b]));
    places.iter().zip(&seen).for_each(|(&to, &from)| labels[to] = before[from]);
    let wrong_groups = of_groups(&mut zigzag, &groups)?;
    assert!(wrong_groups.as_ref().is_some_and(|of| of.supported[0].1 == 0.0), "no label is sure");
    let of_photo =
        |lab: &mut Lab, found| lab.verify_compensation(found).map(|of| of.map(|of| of.verification));
    let right = compensated(&mut zigzag)?;
    let right_photo = of_photo(&mut zigzag, &right)?;
    let wrong = compensated(&mut lab(builtin::corner().to_scene())?)?;
    let wrong_photo = of_photo(&mut zigzag, &wrong)?;
    let verdict = |of: Option<Verification>| of.map_or(CheckVerdict::TooWeak, |of| of.verdict);
    let of_groups = |of: Option<crate::lab::Verified>| verdict(of.map(|of| of.verification));
    Ok((
        [verdict(right_pairs), of_groups(right_groups), verdict(right_photo)],
        [verdict(wrong_pairs), of_groups(wrong_groups), verdict(wrong_photo)],
    ))
}

/// For each kind of answer, the number of correct answers that do not pass, and the number of wrong answers that are not refuted.
fn mistakes(seeds: std::ops::Range<u32>) -> Result<[[usize; 3]; 2]> {
    let mut counts = [[0; 3]; 2];
    for seed in seeds {
        let (right, wrong) = verdicts(seed)?;
        for kind in 0..3 {
            counts[0][kind] += usize::from(right[kind] != CheckVerdict::Passed);
            counts[1][kind] += usize::from(wrong[kind] != CheckVerdict::Refuted);
        }
    }
    Ok(counts)
}

#[test]
fn wrong_answers_are_refuted_and_right_ones_are_not() -> Result<()> {
    // If one answer in a hundred is misjudged, the chance of two or more mistakes in six seeds of one kind is 0.0015.
    let counts = mistakes(100..106)?;
    assert!(counts.as_flattened().iter().all(|&count| count <= 1), "right, wrong: {counts:?}");
    Ok(())
}

#[test]
#[ignore = "a minute: cargo test --release --lib -- --ignored in_a_hundred_seeds"]
fn in_a_hundred_seeds_one_mistake_is_made_at_most() -> Result<()> {
    let counts = mistakes(0..100)?;
    println!("right answers refuted, wrong ones not refuted: {counts:?}");
    assert!(counts.as_flattened().iter().all(|&count| count <= 1), "right, wrong: {counts:?}");
    Ok(())
}

#[test]
fn the_headline_of_a_segmentation_counts_refuted_regions() -> Result<()> {
    let mut found = zigzag()?.ask(&Segment { groups: vec![2], photos: Some(12), ..Segment::default() })?;
    assert!(!found.headline().contains("refuted"), "{}", found.headline());
    found.refuted = 1;
    assert!(found.headline().contains(", 1 refuted;"), "{}", found.headline());
    assert!(found.headline().split_whitespace().count() < 20, "{}", found.headline());
    Ok(())
}

#[test]
fn the_page_of_a_refuted_answer_says_so() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    for (factor, is_refuted) in [(1.0, false), (3.0, true)] {
        let run = folder.path().join(factor.to_string());
        let mut lab = zigzag()?;
        lab.begin_run("eigs", &RunOptions { folder: Some(run.clone()), ..RunOptions::default() })?;
        let mut found = pairs().pairs(&mut lab)?;
        found.found.values.iter_mut().for_each(|value| *value *= factor);
        found.verify(&mut lab)?;
        assert_eq!(found.headline().contains("refuted by independent light"), is_refuted);
        assert!(!is_refuted || !found.headline().contains("within the noise"), "{}", found.headline());
        let saved = lab.finish(&found)?;
        let checks: Vec<Grade> =
            saved.findings.iter().filter(|of| of.name == "check").map(|of| of.grade).collect();
        assert_eq!(checks, [if is_refuted { Grade::Fails } else { Grade::Ok }]);
        let read = |name: &str| std::fs::read_to_string(run.join(name)).map_err(Error::reading(&run));
        let (page, record) = (read("report.html")?, read("run.json")?);
        // The colour of the page and the sentence at its top follow from this finding.
        assert_eq!(
            page.contains("check fails: refuted: photos of the eigenvectors by light paths of another seed"),
            is_refuted
        );
        let is_good = saved.findings.iter().all(|finding| finding.grade == Grade::Ok);
        assert_eq!(page.contains("class=\"verdict good\""), is_good);
        assert_eq!(record.contains("\"verdict\": \"refuted\""), is_refuted, "{record}");
        // The sentence with the stated eigenvalue explains the refutation.
        assert_eq!(page.contains("its eigenvalue is stated as"), is_refuted);
    }
    Ok(())
}
