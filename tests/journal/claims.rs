//! A run keeps the claims of confirmations, and only the photos of its searches.

use std::path::Path;

use krylux::analysis::segment::{Capture, SegmentOptions, Unseen};
use krylux::image::Resolution;
use krylux::journal::{Journal, Kind};
use krylux::krylov::{Eigs, EigsOptions, Singular, SingularOptions, eigs, singular};
use krylux::lab::{Lab, RunOptions};
use krylux::transport::Part;

fn opened(source: &Path, folder: Option<&Path>) -> Lab {
    let run = RunOptions {
        folder: folder.map(Path::to_path_buf),
        resume: folder.is_some_and(Path::exists),
        ..RunOptions::default()
    };
    let builder = Lab::builder(source);
    let builder = if folder.is_some() { builder.size(24, 24).samples(24).run(run) } else { builder };
    builder.open().expect("the source is there")
}

fn asked(lab: &mut Lab) -> (Eigs, Singular, Unseen) {
    let mut operator = lab.operator(Part::Global).expect("there is light");
    let options = EigsOptions { count: 3, products: 60, tolerance: 1e-6, ..EigsOptions::default() };
    let pairs = eigs(&mut operator, &options).expect("the photos are taken");
    let options = SingularOptions { count: 2, products: 80, tolerance: 1e-5, ..SingularOptions::default() };
    let triplets = singular(&mut operator, &options).expect("the photos are taken");
    let resolution = Some(Resolution::new(24, 24));
    let options = SegmentOptions { groups: vec![2], photos: 20, resolution, ..SegmentOptions::default() };
    let mut capture = Capture::new(options).expect("good options");
    capture.run(&mut operator).expect("the photos are taken");
    let found = capture.segmentation().expect("there are eigenvectors");
    let photos = pairs.stats.products + triplets.stats.products + found.photos;
    assert_eq!(operator.photos(), photos, "products that confirm are no photos");
    (pairs, triplets, found.regions.unseen)
}

/// The numbers of photos and of claims in the journal of a run, and its bytes.
fn kept(run: &Path) -> (usize, usize, u64) {
    let folder = run.join("journal");
    let journal = Journal::read_only(&folder).expect("it is whole");
    let claims = journal.entries().iter().filter(|entry| {
        entry.kind == Kind::Note && entry.metadata.starts_with(b"claim of Global, channel 0: ")
    });
    let bytes = std::fs::metadata(super::file(&folder)).expect("it is there").len();
    (journal.photos(), claims.count(), bytes)
}

#[test]
fn a_run_keeps_claims_and_answers_with_them_where_there_is_no_scene() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = folder.path().join("run");
    let scene = Path::new("assets/scenes/cornell/scene.glb");
    let first = asked(&mut opened(scene, Some(&run)));
    assert!(first.0.completeness.is_known() && first.1.completeness.is_known(), "{first:?}");
    assert!(first.2.completeness.is_known() && first.0.confirming > 0 && first.1.confirming > 0);
    let (photos, claims, bytes) = kept(&run);
    // The photo of white, and those of two searches, serve several methods.
    assert!(photos <= first.0.stats.products + first.1.stats.products + 20, "{photos} photos");
    assert_eq!(claims, 3);
    // The same run with its scene takes nothing more, and the folder alone gives the same bits.
    for again in [asked(&mut opened(scene, Some(&run))), asked(&mut opened(&run, None))] {
        assert_eq!(format!("{again:?}"), format!("{first:?}"));
        assert_eq!(kept(&run), (photos, claims, bytes));
    }
}
