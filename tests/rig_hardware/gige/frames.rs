//! The counts of frames equal the scene's.

use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::measure::FrameSource;
use krylux::rig::{Camera, Colour, Frame, GenicamSpec, GigeVision, PixelFormat, Projector, WallClock};

use super::support::{Lamp, SIZE, address, camera, expected, frame, live, scene, shot, spec};
use crate::gige_camera::GigeCamera;

#[test]
fn counts_are_those_of_the_scene_in_every_gray_format() {
    use PixelFormat as F;
    let formats =
        [F::Mono8, F::Mono10, F::Mono10p, F::Mono10Packed, F::Mono12, F::Mono12p, F::Mono12Packed, F::Mono16];
    for (at, format) in formats.into_iter().enumerate() {
        let (clock, last) = (WallClock::starting_at(0.0), 50 + at as u8);
        let mut lamp = Lamp::new(clock);
        lamp.show(&frame(3)).expect("a lamp shows all");
        let scene = scene(format.bits());
        let _camera = GigeCamera::start(address(last), scene.clone(), lamp.look());
        let spec = GenicamSpec { pixel_format: format, ..spec(last) };
        let mut opened = GigeVision::open(&spec, clock, 0).expect("it answers");
        assert_eq!(opened.configure(0.05).expect("within range"), 0.05);
        let found = opened.capture().expect("it is there").expect("it comes");
        assert_eq!((found.resolution, found.channels, found.exposure), (SIZE, 1, 0.05));
        assert_eq!(found.counts, expected(&scene, &frame(3), 0.05), "{format:?}");
        assert!(
            found.counts.iter().any(|&count| u32::from(count) >= 1 << (format.bits() - 3)),
            "there is light"
        );
    }
}

/// The four counts of the cell at column `x` and row `y` of a sensor that is 48 photosites wide, row by row.
fn cell(counts: &[u16], x: usize, y: usize) -> [u32; 4] {
    [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[right, down]| counts[(2 * y + down) * 48 + 2 * x + right].into())
}

#[test]
fn a_colour_sensors_cells_become_pixels_in_every_bayer_format() {
    use PixelFormat as F;
    // The positions of red, the two greens and blue in a cell, counted row by row.
    let orders = [
        ([0, 1, 2, 3], [F::BayerRG12, F::BayerRG12p, F::BayerRG12Packed, F::BayerRG8].as_slice()),
        ([1, 0, 3, 2], &[F::BayerGR12, F::BayerGR12p, F::BayerGR12Packed]),
        ([2, 0, 3, 1], &[F::BayerGB12, F::BayerGB12p, F::BayerGB12Packed, F::BayerGB16]),
        ([3, 1, 2, 0], &[F::BayerBG12, F::BayerBG12p, F::BayerBG12Packed]),
    ];
    let formats =
        orders.iter().flat_map(|(places, formats)| formats.iter().map(move |format| (places, *format)));
    for (at, (&[red, green, other, blue], format)) in formats.enumerate() {
        let (clock, last) = (WallClock::starting_at(0.0), 60 + at as u8);
        let mut lamp = Lamp::new(clock);
        lamp.show(&frame(3)).expect("a lamp shows all");
        let scene = scene(format.bits());
        let _camera = GigeCamera::start(address(last), scene.clone(), lamp.look());
        let sites = expected(&scene, &frame(3), 0.05);
        for (colour, channels, bits) in [(Colour::Rgb, 3, 1), (Colour::Luma, 1, 2), (Colour::Green, 1, 1)] {
            let spec = GenicamSpec { pixel_format: format, colour, ..spec(last) };
            let mut opened = GigeVision::open(&spec, clock, 0).expect("it answers");
            let info = opened.info().clone();
            assert_eq!((info.resolution, info.channels), (Resolution::new(24, 10), channels));
            assert_eq!(info.bits, (format.bits() + bits).min(16), "{format:?}");
            opened.configure(0.05).expect("within range");
            let found = opened.capture().expect("it is there").expect("it comes");
            found.check().expect("its counts fill it");
            assert_eq!((found.resolution, found.channels), (info.resolution, channels));
            // Sums of 16-bit counts are halved or quartered to fit 16 bits, and halves are rounded up.
            let halvings = format.bits() + bits - info.bits;
            let scaled = |sum: u32| ((sum + (1 << halvings) / 2) >> halvings) as u16;
            for pixel in 0..240 {
                let sites = cell(&sites, pixel % 24, pixel / 24);
                let greens = sites[green] + sites[other];
                let wanted: Vec<u16> = match colour {
                    Colour::Rgb => [2 * sites[red], greens, 2 * sites[blue]].map(scaled).to_vec(),
                    Colour::Luma => vec![scaled(sites[red] + greens + sites[blue])],
                    Colour::Green => vec![scaled(greens)],
                };
                let counts = &found.counts[pixel * channels..][..channels];
                assert_eq!(counts, wanted, "{format:?} {colour:?}, pixel {pixel}");
            }
        }
    }
}

#[test]
fn a_cell_with_a_saturated_photosite_is_saturated_in_all_channels() {
    let clock = WallClock::starting_at(0.0);
    let mut lamp = Lamp::new(clock);
    lamp.show(&frame(3)).expect("a lamp shows all");
    let _camera = camera(80, &lamp);
    let spec = GenicamSpec { pixel_format: PixelFormat::BayerRG12p, saturation: Some(4000), ..spec(80) };
    let mut opened = GigeVision::open(&spec, clock, 0).expect("it answers");
    opened.configure(0.2).expect("within range");
    let found = opened.capture().expect("it is there").expect("it comes");
    let sites = expected(&scene(12), &frame(3), 0.2);
    let mut full = 0;
    for (pixel, counts) in found.counts.chunks(3).enumerate() {
        let is_full = cell(&sites, pixel % 24, pixel / 24).iter().any(|&count| count >= 4000);
        full += usize::from(is_full);
        assert!(counts.iter().all(|&count| (count == 8191) == is_full), "pixel {pixel}: {counts:?}");
    }
    assert!((1..240).contains(&full), "some are full, some are not: {full}");
}

#[test]
fn a_region_of_a_colour_sensor_consists_of_whole_cells() {
    let clock = WallClock::starting_at(0.0);
    let mut lamp = Lamp::new(clock);
    lamp.show(&frame(5)).expect("a lamp shows all");
    let _camera = camera(81, &lamp);
    let spec = GenicamSpec {
        pixel_format: PixelFormat::BayerGB12Packed,
        size: [16, 8],
        offset: [30, 12],
        ..spec(81)
    };
    let spec = GenicamSpec { colour: Colour::Luma, ..spec };
    let mut opened = GigeVision::open(&spec, clock, 0).expect("it answers");
    opened.configure(0.02).expect("within range");
    let found = opened.capture().expect("it is there").expect("it comes");
    assert_eq!(found.resolution, Resolution::new(8, 4));
    let whole = expected(&scene(12), &frame(5), 0.02);
    for (at, &count) in found.counts.iter().enumerate() {
        let sum: u32 = cell(&whole, 15 + at % 8, 6 + at / 8).iter().sum();
        assert_eq!(u32::from(count), sum, "pixel {at}");
    }
}

#[test]
fn a_region_is_the_same_part_of_the_whole_frame() {
    let clock = WallClock::starting_at(0.0);
    let mut lamp = Lamp::new(clock);
    lamp.show(&frame(5)).expect("a lamp shows all");
    let _camera = camera(5, &lamp);
    let spec = GenicamSpec { size: [16, 9], offset: [30, 11], ..spec(5) };
    let mut opened = GigeVision::open(&spec, clock, 0).expect("it answers");
    opened.configure(0.02).expect("within range");
    let found = opened.capture().expect("it is there").expect("it comes");
    assert_eq!(found.resolution, Resolution::new(16, 9));
    let whole = expected(&scene(12), &frame(5), 0.02);
    for (at, &count) in found.counts.iter().enumerate() {
        assert_eq!(count, whole[(11 + at / 16) * 48 + 30 + at % 16], "pixel {at}");
    }
}

#[test]
fn exposures_take_their_time_and_gain_multiplies() {
    let clock = WallClock::starting_at(0.0);
    let mut lamp = Lamp::new(clock);
    lamp.show(&frame(1)).expect("a lamp shows all");
    let _camera = camera(6, &lamp);
    let spec = GenicamSpec { gain: Some(20.0 * 2_f64.log10()), ..spec(6) };
    let mut opened = GigeVision::open(&spec, clock, 0).expect("it answers");
    for exposure in [0.001, 0.02, 0.06] {
        // This camera rounds to whole microseconds.
        let set = opened.configure(exposure + 3e-7).expect("within range");
        assert!((set - exposure).abs() < 1e-12, "{set}");
        let began = Instant::now();
        let found = opened.capture().expect("it is there").expect("it comes");
        assert!(began.elapsed().as_secs_f64() >= exposure);
        let twice = expected(&scene(12), &frame(1), 2.0 * exposure);
        assert!(found.counts.iter().zip(&twice).all(|(found, twice)| found.abs_diff(*twice) <= 1));
    }
}

#[test]
fn frames_are_numbered_and_timed_by_the_rigs_clock() {
    let clock = WallClock::starting_at(1000.0);
    let lamp = Lamp::new(clock);
    let _camera = camera(7, &lamp);
    let mut opened = GigeVision::open(&spec(7), clock, 41).expect("it answers");
    opened.configure(0.004).expect("within range");
    let mut last = 0.0;
    for number in 42..50 {
        let before = clock.seconds();
        let found = opened.capture().expect("it is there").expect("it comes");
        let after = clock.seconds();
        assert_eq!(found.id, number);
        assert!(
            found.started >= before && found.started + found.exposure <= after,
            "{} in {before}..{after}",
            found.started
        );
        assert!(found.started >= last + found.exposure, "one after another");
        last = found.started;
    }
}

#[test]
fn each_of_hundreds_of_patterns_has_its_own_photo() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let _camera = camera(8, &lamp);
    let mut shots = live(&spec(8), &lamp, clock).expect("it answers");
    let scene = scene(12);
    shots.capture(&shot(0, 0.002)).expect("it comes");
    let (began, count) = (Instant::now(), 200);
    for number in 1..=count {
        let found = shots.capture(&shot(number, 0.002)).expect("it comes");
        if number % 20 == 0 {
            assert_eq!(found.counts, expected(&scene, &frame(number), 0.002), "pattern {number}");
        }
    }
    let each = began.elapsed().as_secs_f64() / count as f64;
    println!("{:.2} ms for each photo of 2 ms, {} pixels", 1e3 * each, SIZE.pixels());
    let effort = shots.effort();
    assert_eq!([effort.taken, effort.dropped, effort.repeated], [count as u64 + 1, 0, 0]);
}

#[test]
fn a_pattern_that_changes_during_an_exposure_is_seen_in_part() {
    // The simulated camera integrates light over the exposure, as a real one does.
    let clock = WallClock::starting_at(0.0);
    let mut lamp = Lamp::new(clock);
    let [first, second] = [8, 40].map(|level| Frame::filled(SIZE, 1, level));
    lamp.show(&first).expect("a lamp shows all");
    let device = camera(9, &lamp);
    let mut opened = GigeVision::open(&spec(9), clock, 0).expect("it answers");
    opened.configure(0.4).expect("within range");
    let before = device.looks();
    let found = std::thread::scope(|scope| {
        scope.spawn(|| {
            let began = Instant::now();
            while device.looks() == before {
                assert!(began.elapsed().as_secs() < 10, "it was never exposed");
                std::thread::sleep(Duration::from_millis(1));
            }
            lamp.show(&second).expect("a lamp shows all");
        });
        opened.capture().expect("it is there").expect("it comes")
    });
    let [first, second] = [first, second].map(|frame| expected(&scene(12), &frame, 0.4));
    for (pixel, &count) in found.counts.iter().enumerate() {
        assert!(first[pixel] < count && count < second[pixel], "pixel {pixel}: {count}");
    }
}
