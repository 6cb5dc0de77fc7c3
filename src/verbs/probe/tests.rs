//! Masks on a scene whose projector stands beside the camera, and on virtual devices in front of it.

use super::*;
use crate::measure::RigFile;
use crate::scene::{Scene, builtin};

const SIDE: usize = 16;

fn beside() -> Scene {
    let mut scene = builtin::zigzag().to_scene();
    let mut projector = scene.camera.clone();
    projector.position += 0.3 * projector.right + 0.1 * projector.up;
    scene.projector = Some(projector);
    scene
}

fn open(scene: Scene) -> Result<Lab> {
    Lab::builder_of_scene(scene).size(SIDE, SIDE).samples(64).seed(3).open()
}

fn named(mask: &str, photos: Option<usize>) -> Probe {
    Probe { mask: mask.parse().ok(), photos, ..Probe::default() }
}

const MASKS: [&str; 5] = ["row", "column", "epipolar", "band:-1,2", "beyond:3"];

#[test]
fn photos_of_a_scene_apart_agree_with_its_matrix_and_tell_their_errors() -> Result<()> {
    for mask in MASKS {
        let mut lab = open(beside())?;
        let found = lab.ask(&named(mask, Some(SIDE * SIDE)))?;
        let error = found.error().unwrap_or(f64::NAN);
        println!("{mask}: {} photos, within {error:.1e}", found.photos);
        assert!(error < 1e-6 && found.noise().value() == Some(0.0), "{mask}: {error}");
        let few = lab.ask(&named(mask, Some(5)))?;
        let (error, noise) = (few.error().unwrap_or(f64::NAN), few.noise().value().unwrap_or(f64::NAN));
        println!("{mask}: {} photos, within {error:.3} by {noise:.3}", few.photos);
        // Random patterns are common to all pixels, so the errors are those of few independent draws.
        assert!((0.4..2.5).contains(&(error / noise)), "{mask}: {error} {noise}");
    }
    let default = open(beside())?.ask(&named("row", None))?;
    assert!(default.photos <= SIDE && default.error().is_some_and(|error| error < 1e-6));
    assert!(default.headline().split_whitespace().count() < 20, "{}", default.headline());
    Ok(())
}

#[test]
fn direct_light_goes_along_epipolar_lines() -> Result<()> {
    let mut lab = open(beside())?;
    let direct = lab.matrix(Part::Direct, 0)?;
    let [camera, projector] = lab.epipolar_lines()?;
    let share = |shift: usize| -> Result<f64> {
        let moved: Vec<_> = (0..camera.len()).map(|at| camera[(at + shift) % camera.len()]).collect();
        let seen = Mask::lines(&moved, &projector)?.exact(&direct);
        Ok(seen.iter().sum::<f64>() / direct.weights().iter().sum::<f64>())
    };
    let [right, wrong] = [share(0)?, share(3 * SIDE)?];
    println!("{right:.3} of the direct light is on the lines, {wrong:.3} three rows farther");
    // Pixels are as wide as lines, so some direct light falls on the line beside.
    assert!(right > 0.6 && wrong < 0.2, "{right} {wrong}");
    let said = |lab: &mut Lab| lab.ask(&named("epipolar", None)).err().map(|error| error.to_string());
    assert!(said(&mut open(builtin::zigzag().to_scene())?).is_some_and(|said| said.contains("coaxial")));
    let mut matrix = Lab::builder_of_matrix(direct, "direct").size(SIDE, SIDE).open()?;
    assert!(said(&mut matrix).is_some_and(|said| said.contains("poses")));
    let both = Probe { sigma: Some(1.0), ..named("row", None) };
    assert!(lab.ask(&both).is_err_and(|error| error.to_string().contains("--sigma")));
    Ok(())
}

/// A count of the camera is an electron, as an uncalibrated rig takes it to be.
fn devices() -> Result<RigFile> {
    let text = include_str!("../../../assets/rigs/ideal.toml")
        .replace("bits = 16", "bits = 16\nfull_well = 65535\nshot_noise = true");
    RigFile::from_bytes("assets/rigs/ideal.toml".as_ref(), text.as_bytes())
}

#[test]
fn a_virtual_rig_apart_is_as_far_off_as_it_says() -> Result<()> {
    let mut exact = open(beside())?;
    let matrix = exact.matrix(Part::Full, 0)?;
    let unit = {
        let seen = exact.through_rig(devices()?)?.white()?.plane(0);
        seen.iter().sum::<f64>() / matrix.weights().iter().sum::<f64>()
    };
    for mask in MASKS {
        for photos in [SIDE * SIDE, 12] {
            let mut rig = exact.through_rig(devices()?)?;
            let found = rig.ask(&named(mask, Some(photos)))?;
            let frames = rig.costs()?.map_or(0, |costs| costs.effort.frames());
            let choice: MaskChoice = mask.parse().expect("it is one of those above");
            let of_matrix = choice.mask(&mut exact)?;
            let truth = of_matrix.exact(&matrix);
            let deviation = |truth: &[f64]| {
                let squares: f64 =
                    (0..truth.len()).map(|j| (found.values[0][j] - unit * truth[j]).powi(2)).sum();
                (squares / found.standard_errors[0].iter().map(|error| error * error).sum::<f64>()).sqrt()
            };
            let shifted: Vec<f64> = (0..truth.len()).map(|j| truth[(j + SIDE) % truth.len()]).collect();
            let [right, wrong] = [deviation(&truth), deviation(&shifted)];
            println!(
                "{mask}: {} photos, {frames} frames, standard error {:?}, off by {right:.2} of it, shifted by {wrong:.2}",
                found.photos,
                found.noise().value()
            );
            if of_matrix.parts() <= photos {
                assert!((0.6..1.6).contains(&right) && wrong > 3.0, "{mask}: {right} {wrong}");
            } else {
                assert!((0.4..2.5).contains(&right), "{mask}: {right}");
            }
        }
    }
    Ok(())
}

#[test]
fn weights_come_from_files_and_arrays_and_must_fit() -> Result<()> {
    let folder = tempfile::tempdir().map_err(Error::writing("a temporary folder"))?;
    let path = folder.path().join("mask.npz");
    let n = SIDE * SIDE;
    let columns = (0..n).flat_map(|j| (0..SIDE).map(move |x| (j / SIDE * SIDE + x) as u32)).collect();
    let weights = Csr::new(n, (0..=n).map(|j| j * SIDE).collect(), columns, vec![1.0; n * SIDE])?;
    crate::io::sparse::write(&path, &weights)?;
    let of_file = named(&path.display().to_string(), None);
    let mut lab = open(builtin::zigzag().to_scene())?;
    let [by_file, by_name] = [lab.ask(&of_file)?, lab.ask(&named("row", None))?];
    assert!(by_file.photos == SIDE && by_file.values == by_name.values);
    let mut small = Lab::builder_of_scene(beside()).size(8, 8).samples(1).open()?;
    assert!(small.ask(&of_file).is_err_and(|error| error.to_string().contains("--mask")));
    for wrong in ["rows", "row:1", "band:3", "band:2,1", "beyond:-1", "beyond:x"] {
        assert!(wrong.parse::<MaskChoice>().is_err(), "{wrong}");
    }
    let array = |name: &str, value: f64| GivenArray {
        field: "mask".into(),
        name: name.into(),
        shape: vec![1, n],
        values: vec![value; n],
    };
    let mut twice = Probe::default();
    twice.give(vec![array("masks", 2.0), array("patterns", 1.0)])?;
    let (found, white) = (lab.ask(&twice)?, lab.white_of(Part::Full)?);
    let off = found.values[0].iter().zip(&white[0]).map(|(found, white)| (found - 2.0 * white).abs());
    assert!(found.photos == 1 && off.fold(0.0, f64::max) < 1e-6 * white[0].iter().sum::<f64>());
    Ok(())
}

#[test]
fn light_that_is_not_there_is_a_finding_and_no_number() {
    let of = |values: Vec<f64>, error: f64, truth: Option<Vec<f64>>| {
        let standard_errors = vec![error; values.len()];
        let probed = Probed { values, standard_errors, photos: 3 };
        let truth = truth.map(|truth| vec![truth]);
        let paths = ["indirect", "indirect light", ""].map(String::from);
        ProbedLight::new(paths, Resolution::new(2, 2), vec![probed], truth)
    };
    let (noise, nothing) = (vec![0.1, -0.1, 0.1, -0.1], Some(vec![0.0; 4]));
    for dark in
        [of(vec![0.0; 4], 0.0, nothing.clone()), of(noise.clone(), 0.1, None), of(noise, 0.1, nothing)]
    {
        let [finding] = &dark.findings()[..] else { unreachable!("a finding") };
        assert!(finding.grade == Grade::Unmeasured && finding.found.contains("no indirect light to measure"));
        let sentence = dark.sentence();
        assert!(!sentence.contains("NaN") && !sentence.contains("inf"), "{sentence}");
    }
    let lit = of(vec![1.0; 4], 0.1, None);
    assert!(lit.findings().is_empty() && lit.noise().value().is_some_and(|noise| (noise - 0.1).abs() < 1e-3));
}
