//! Audits of virtual rigs: each fault is named with its value, and nothing else is.

use krylux::bench::audit::{AuditOptions, AuditReport, Exact, audit};
use krylux::calibrate::CalibrateOptions;
use krylux::finding::Grade;
use krylux::image::Resolution;
use krylux::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use krylux::operator::{Operator, Symmetry};
use krylux::rig::VirtualRig;

use super::scene::Folded;
use super::{calibrated, realistic};

const SIZE: Resolution = Resolution { width: 32, height: 32 };

fn audited(
    rig: &VirtualRig,
    scene: &Folded,
    calibration: Calibration,
    options: MeasureOptions,
) -> AuditReport {
    let bench = rig.open(Box::new(scene.clone()), None).expect("the scene fits its rig");
    let settle = calibration.stability.settle;
    let frames = Box::new(LiveFrames::new(bench, settle, 5));
    let mut rig = Measurement::new(frames, calibration, options).expect("options that make sense");
    audit(&mut rig, &AuditOptions::default()).expect("the bench can be audited")
}

fn ideal(rig: &VirtualRig) -> Calibration {
    Calibration::ideal(&rig.projector_info(), &rig.camera_info())
}

fn failed(audit: &AuditReport) -> Vec<&str> {
    audit.checks.iter().for_each(|check| println!("{check}"));
    audit.checks.iter().filter(|check| check.grade == Grade::Fails).map(|check| &*check.name).collect()
}

fn figure(audit: &AuditReport, name: &str) -> f64 {
    audit.checks.iter().find(|check| check.name == name).and_then(|check| check.value).unwrap_or(f64::NAN)
}

#[test]
fn an_ideal_bench_passes() {
    let scene = Folded::new(SIZE, 0.3);
    let rig = scene.rig();
    let audit = audited(&rig, &scene, ideal(&rig), MeasureOptions::default());
    assert_eq!(failed(&audit), [""; 0], "{}", audit.sentence());
}

#[test]
fn every_imperfection_at_once_passes_after_calibration_and_not_before() {
    let scene = Folded::new(Resolution::new(64, 64), 0.3);
    let rig = realistic(&scene);
    // An exposure that is chosen without knowing the noise saturates, and then saturation would be the only
    // finding.
    let short = MeasureOptions { exposures: vec![0.1], ..MeasureOptions::default() };
    let before = audited(&rig, &scene, ideal(&rig), short);
    let names = failed(&before);
    assert!(names.contains(&"homogeneity") && names.contains(&"symmetry"), "{names:?}");
    let (calibration, _) =
        calibrated(&rig, &scene, &CalibrateOptions { takes: 1, ..CalibrateOptions::default() });
    let after = audited(&rig, &scene, calibration, MeasureOptions::default());
    assert_eq!(failed(&after), [""; 0], "{}", after.sentence());
}

#[test]
fn a_gamma_that_is_not_corrected_fails_homogeneity() {
    let scene = Folded::new(SIZE, 0.3);
    let mut rig = scene.rig();
    rig.projector.gamma = Some(2.2);
    let audit = audited(&rig, &scene, ideal(&rig), MeasureOptions::default());
    assert_eq!(failed(&audit), ["homogeneity"]);
    // 0.25^2.2 / 0.25 = 0.19.
    assert!((figure(&audit, "homogeneity") - 0.81).abs() < 0.01, "{}", figure(&audit, "homogeneity"));
}

#[test]
fn a_scene_that_saturates_fails_saturation() {
    let scene = Folded::new(SIZE, 0.3);
    let rig = scene.rig();
    let options = MeasureOptions { exposures: vec![5.0], ..MeasureOptions::default() };
    let audit = audited(&rig, &scene, ideal(&rig), options);
    assert_eq!(failed(&audit), ["saturation"]);
}

#[test]
fn a_camera_half_a_pixel_off_fails_symmetry() {
    let scene = Folded::new(SIZE, 0.3);
    let mut rig = scene.rig();
    rig.camera.shift = [0.5, 0.0];
    let audit = audited(&rig, &scene, ideal(&rig), MeasureOptions::default());
    assert_eq!(failed(&audit), ["symmetry"]);
    // Half of the direct light d moves to the neighbour: ‖A − Aᵀ‖² = Σ d²/2, and ‖A‖² = Σ d²/2, to which
    // global light adds. Fifteen pairs measure it to a fifth.
    assert!((0.5..1.4).contains(&figure(&audit, "symmetry")), "{}", figure(&audit, "symmetry"));
}

#[test]
fn a_fading_lamp_fails_repeatability_unless_sentinels_correct_it() {
    let scene = Folded::new(SIZE, 0.3);
    let mut rig = scene.rig();
    // A photo takes seconds, and the lamp loses a tenth per minute.
    rig.camera.readout = 1.0;
    rig.drift.per_hour = -6.0;
    let unwatched = MeasureOptions { sentinel_every: 0, ..MeasureOptions::default() };
    let audit = audited(&rig, &scene, ideal(&rig), unwatched);
    assert!(failed(&audit).contains(&"repeatability"), "{:?}", failed(&audit));
    let watched = MeasureOptions { sentinel_every: 2, ..MeasureOptions::default() };
    let audit = audited(&rig, &scene, ideal(&rig), watched);
    assert_eq!(failed(&audit), [""; 0]);
    assert!(figure(&audit, "drift") > 0.01, "the drift of the lamp is reported although it is corrected");
}

/// A scene that the camera sees with an offset of two pixels, without direct light in the shadow.
struct Aside(Folded);

impl Operator for Aside {
    fn rows(&self) -> usize {
        SIZE.pixels()
    }

    fn cols(&self) -> usize {
        SIZE.pixels()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        let photo = self.0.apply(x);
        for (pixel, value) in y.iter_mut().enumerate() {
            let column = (pixel % SIZE.width + 2).min(SIZE.width - 1);
            *value = photo[pixel / SIZE.width * SIZE.width + column];
        }
        Ok(())
    }
}

#[test]
fn a_camera_beside_the_projector_fails_symmetry_and_shows_shadows() {
    let direct = (0..SIZE.pixels()).map(|pixel| if pixel % SIZE.width < 8 { 0.0 } else { 0.5 }).collect();
    let mut aside = Aside(Folded::new(SIZE, 0.3));
    let mut exact = Exact { full: &mut aside, direct: Some(direct), resolution: SIZE, patterns: SIZE };
    let audit = audit(&mut exact, &AuditOptions::default()).expect("an operator can be audited");
    assert_eq!(failed(&audit), ["symmetry", "direct light"]);
    assert!((figure(&audit, "direct light") - 0.25).abs() < 0.01, "a quarter of the columns");
    assert!(figure(&audit, "additivity") < 1e-12 && figure(&audit, "homogeneity") < 1e-12);
}

/// A scene without light: nothing is accused of what was never measured.
#[test]
fn an_audit_of_darkness_has_nothing_to_measure() {
    struct Dark;
    impl Operator for Dark {
        fn rows(&self) -> usize {
            SIZE.pixels()
        }

        fn cols(&self) -> usize {
            SIZE.pixels()
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, _: &[f64], y: &mut [f64]) -> krylux::Result<()> {
            y.fill(0.0);
            Ok(())
        }
    }
    let direct = Some(vec![0.0; SIZE.pixels()]);
    let mut exact = Exact { full: &mut Dark, direct, resolution: SIZE, patterns: SIZE };
    let dark = audit(&mut exact, &AuditOptions::default()).expect("an operator can be audited");
    assert_eq!(failed(&dark), ["light"]);
    assert!(!dark.passed() && dark.sentence().contains("nothing to measure"), "{}", dark.sentence());
    assert!(dark.checks.iter().skip(1).all(|check| check.grade == Grade::Unmeasured));
    // A bench with the lens cap on.
    let scene = Folded::new(SIZE, 0.3);
    let mut rig = scene.rig();
    rig.camera.white_exposure = 1e5;
    rig.camera.read_noise = 5.0;
    let capped = audited(&rig, &scene, ideal(&rig), MeasureOptions::default());
    assert_eq!(failed(&capped), ["light"], "{}", capped.sentence());
}
