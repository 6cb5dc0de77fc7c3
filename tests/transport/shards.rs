//! Parts of a matrix that are traced by themselves: together they are the matrix, and nothing else is.

use crate::common::{load, settings, tracer};
use krylux::image::Resolution;
use krylux::render::{StartPixels, TraceSettings, TraceSummary, Tracer};
use krylux::transport::{
    Assembled, Channels, MOST_PARTS, RigShape, Shard, ShardRecord, assemble_layers, join_shards, trace_shard,
};

const PARTS: usize = 3;

fn shards(tracer: &mut Tracer, settings: &TraceSettings, channels: Channels, split: bool) -> Vec<Shard> {
    let shard =
        |part| trace_shard(tracer, settings, channels, split, (part, PARTS)).expect("it can be traced");
    (1..=PARTS).map(shard).collect()
}

/// The shard after it was written to a file and read again.
fn read_again(shard: &Shard) -> Shard {
    let mut bytes = Vec::new();
    shard.write(&mut bytes).expect("memory takes all bytes");
    Shard::read(shard.record().clone(), &mut &bytes[..], bytes.len() as u64).expect("it is whole")
}

fn same(joined: &Assembled, whole: &Assembled) -> bool {
    joined.matrix == whole.matrix
        && joined.ambient == whole.ambient
        && joined.noise == whole.noise
        && (joined.summary.paths, joined.summary.rays) == (whole.summary.paths, whole.summary.rays)
}

#[test]
fn joined_parts_have_the_bits_of_the_whole() {
    let mut scene = load("cornell");
    // With ambient light, which each part has for its pixels.
    scene.materials[0].emission = glam::vec3(0.01, 0.02, 0.03);
    let mut tracer = tracer(&scene);
    // Parts are assembled on the processor, and a device rounds its sums in another way.
    tracer.assemble_on_device(false);
    let apart = Some(Resolution::new(7, 4));
    for (projector, samples, channels, split) in [
        (None, 4, Channels::Luma, false),
        (None, 3, Channels::Rgb, true),
        (apart, 4, Channels::Rgb, false),
        (apart, 3, Channels::Luma, true),
        // One path of each pixel tells no noise.
        (None, 1, Channels::Luma, false),
    ] {
        let settings = TraceSettings { projector, ..settings(9, samples, 4, 5) };
        let whole = assemble_layers(&mut tracer, &settings, channels, split).expect("it can be traced");
        assert_eq!(whole.noise.is_some(), samples > 1);
        let parts = shards(&mut tracer, &settings, channels, split);
        for (number, part) in (1..).zip(&parts) {
            let record = part.record();
            assert_eq!((record.part, record.parts, record.has_halves), (number, PARTS, samples > 1));
            assert_eq!(
                (record.channels, record.split, record.rig.symmetric),
                (channels, split, projector.is_none())
            );
            let again = read_again(part);
            assert!(part.has_bits_of(&again) && again.has_bits_of(part));
            assert!(
                parts.iter().filter(|other| other.has_bits_of(part)).count() == 1,
                "each has its own paths"
            );
        }
        let reversed = parts.iter().rev().map(read_again).collect();
        let joined = join_shards(reversed).expect("they are all of one matrix");
        assert!(same(&joined, &whole), "{projector:?}, {channels:?}");
        // Two seeds have the same pixels, and other light.
        let other =
            trace_shard(&mut tracer, &TraceSettings { seed: 6, ..settings }, channels, split, (2, PARTS));
        assert!(!other.expect("it can be traced").has_bits_of(&parts[1]));
    }
}

#[test]
fn parts_that_are_not_all_of_one_matrix_are_not_joined() {
    let mut tracer = tracer(&load("corner"));
    let of = settings(8, 2, 3, 5);
    let parts = shards(&mut tracer, &of, Channels::Luma, false);
    let clones = |which: &[usize]| which.iter().map(|&part| parts[part].clone()).collect::<Vec<_>>();
    assert!(join_shards(clones(&[2, 0, 1])).is_ok());
    for (what, which) in
        [("one is missing", &[0, 1][..]), ("one twice", &[0, 1, 1]), ("one more", &[0, 1, 2, 2])]
    {
        let error = join_shards(clones(which)).expect_err(what).to_string();
        assert!(error.contains("parts 1 to 3"), "{what}: {error}");
    }
    assert!(join_shards(Vec::new()).is_err());
    let of_projector = TraceSettings { projector: Some(Resolution::new(7, 8)), ..of };
    let of_size = TraceSettings { resolution: Resolution::new(8, 9), ..of };
    for (what, settings, channels, split) in [
        ("another rig", of_projector, Channels::Luma, false),
        ("another size", of_size, Channels::Luma, false),
        ("other channels", of, Channels::Rgb, false),
        ("other layers", of, Channels::Luma, true),
    ] {
        let mut mixed = clones(&[0, 1]);
        mixed.push(shards(&mut tracer, &settings, channels, split).swap_remove(2));
        assert!(join_shards(mixed).is_err(), "{what}");
    }
    let whole = trace_shard(&mut tracer, &of, Channels::Luma, false, (1, 1)).expect("it can be traced");
    assert!(join_shards(vec![whole, parts[1].clone(), parts[2].clone()]).is_err(), "the first is the whole");
    for part in [(0, 3), (4, 3), (1, 0), (1, MOST_PARTS + 1)] {
        let error =
            trace_shard(&mut tracer, &of, Channels::Luma, false, part).expect_err("there is no such part");
        assert!(error.to_string().contains("--shard"), "{error}");
    }
    assert!(trace_shard(&mut tracer, &of, Channels::Luma, false, (MOST_PARTS, MOST_PARTS)).is_ok());
}

/// A record of a coaxial rig of this size, for the first of `parts` parts.
fn record(width: usize, height: usize, parts: usize) -> ShardRecord {
    let size = Resolution::new(width, height);
    let camera = 0..width * height / parts.max(1);
    ShardRecord {
        part: 1,
        parts,
        rig: RigShape { camera: size, projector: size, symmetric: true },
        channels: Channels::Luma,
        split: false,
        pixels: StartPixels { camera, projector: 0..0 },
        has_halves: true,
        summary: TraceSummary::default(),
    }
}

#[test]
fn records_that_no_trace_makes_are_refused() {
    for (width, height, parts) in [(1, 1, 1), (16_384, 1, 1), (1, 16_384, 1), (512, 256, MOST_PARTS)] {
        assert_eq!(record(width, height, parts).check(), Ok(()), "{width}x{height} in {parts}");
    }
    for (width, height, parts) in
        [(0, 1, 1), (1, 0, 1), (16_385, 1, 1), (1, 16_385, 1), (512, 256, MOST_PARTS + 1), (4, 4, 0)]
    {
        assert!(record(width, height, parts).check().is_err(), "{width}x{height} in {parts}");
    }
    let two = || record(4, 3, 2);
    assert!(ShardRecord { part: 0, ..two() }.check().is_err());
    assert!(ShardRecord { part: 3, ..two() }.check().is_err());
    assert!(ShardRecord { part: 2, ..two() }.check().is_err(), "these are the pixels of the first part");
    let second = StartPixels { camera: 6..12, projector: 0..0 };
    assert_eq!(ShardRecord { part: 2, pixels: second, ..two() }.check(), Ok(()));
    let other = Resolution::new(3, 4);
    let rig = two().rig;
    assert!(
        ShardRecord { rig: RigShape { projector: other, ..rig }, ..two() }.check().is_err(),
        "not coaxial"
    );
    let apart = ShardRecord { rig: RigShape { projector: other, symmetric: false, ..rig }, ..two() };
    assert!(apart.check().is_err(), "the pixels of the projector are missing");
    let pixels = StartPixels { camera: 0..6, projector: 0..6 };
    assert_eq!(ShardRecord { pixels, ..apart }.check(), Ok(()));
    let long = RigShape { projector: Resolution::new(16_385, 1), symmetric: false, ..rig };
    let pixels = StartPixels { camera: 0..6, projector: 0..8192 };
    assert!(ShardRecord { rig: long, pixels, ..two() }.check().is_err(), "the projector is too long");
}

#[test]
fn contributions_of_another_matrix_are_refused() {
    let mut tracer = tracer(&load("corner"));
    let apart = TraceSettings { projector: Some(Resolution::new(7, 5)), ..settings(6, 2, 3, 5) };
    for settings in [settings(6, 2, 3, 5), apart] {
        let split =
            trace_shard(&mut tracer, &settings, Channels::Luma, true, (1, 2)).expect("it can be traced");
        let mut bytes = Vec::new();
        split.write(&mut bytes).expect("memory takes all bytes");
        let read = |record: ShardRecord| Shard::read(record, &mut &bytes[..], bytes.len() as u64);
        let record = split.record().clone();
        assert!(read(record.clone()).is_ok());
        let three = read(ShardRecord { split: false, ..record.clone() });
        assert!(three.is_err_and(|why| why.contains("not to this matrix")), "it has three classes of light");
        let part = tracer.start_pixels(&settings).split(2).swap_remove(1);
        let second = read(ShardRecord { part: 2, pixels: part, ..record.clone() });
        assert!(second.is_err_and(|why| why.contains("not to this matrix")), "its pixels are the first half");
        assert!(read(ShardRecord { channels: Channels::Rgb, ..record }).is_err());
    }
    // Direct light is of a coaxial rig alone.
    let coaxial = trace_shard(&mut tracer, &settings(6, 2, 1, 5), Channels::Luma, false, (1, 1));
    let coaxial = coaxial.expect("it can be traced");
    let mut bytes = Vec::new();
    coaxial.write(&mut bytes).expect("memory takes all bytes");
    let mut record = coaxial.record().clone();
    record.rig.symmetric = false;
    record.pixels.projector = 0..36;
    let read = Shard::read(record, &mut &bytes[..], bytes.len() as u64);
    assert!(read.is_err_and(|why| why.contains("direct or ambient light")));
}
