//! Every level arrives as it is, where it belongs.

use krylux::image::Resolution;
use krylux::rig::{Frame, Projector, X11Spec};

use super::{on, open, spec};
use crate::x_server::XServer;

/// All levels of each channel alone, and of all three together: a row for each.
fn all_levels(shift: usize) -> Frame {
    let mut levels = Vec::new();
    for row in 0..4 {
        for column in 0..256 {
            let level = ((column + shift) % 256) as u16;
            levels.extend((0..3).map(|channel| if row == channel || row == 3 { level } else { 0 }));
        }
    }
    Frame::new(Resolution::new(256, 4), 3, levels).expect("256 columns in 4 rows")
}

#[test]
fn each_level_of_each_channel_arrives_at_its_pixel_of_the_chosen_monitor() {
    let server = XServer::start(640, 240);
    server.add_monitor("left", [0, 0, 300, 240]);
    server.add_monitor("right", [300, 0, 340, 240]);
    for (monitor, left, width) in [("left", 0_i16, 300_i16), ("right", 300, 340)] {
        let spec = X11Spec { monitor: on(monitor), channels: 3, ..spec(&server, [256, 4]) };
        let mut projector = open(&spec).expect("the server is there");
        let corner = left + (width - 256) / 2;
        for shift in [0, 1, 77] {
            let frame = all_levels(shift);
            projector.show(&frame).expect("it is on screen");
            let seen = server.pixels([corner, 118, 256, 4]);
            for (at, (seen, drawn)) in seen.iter().zip(frame.levels().chunks(3)).enumerate() {
                let seen = seen.map(u16::from);
                assert_eq!(seen, [drawn[0], drawn[1], drawn[2]], "{monitor}, pixel {at}");
            }
        }
        // Around the pattern the monitor is black.
        for around in [[left, 0, width, 118], [left, 122, width, 118], [left, 118, corner - left, 4]] {
            assert!(server.pixels(around).iter().all(|&pixel| pixel == [0; 3]), "{monitor}: {around:?}");
        }
        let windows = server.windows();
        drop(projector);
        assert_eq!(server.windows().len(), windows.len() - 1, "the window goes with the projector");
    }
}

#[test]
fn a_gray_pattern_is_magnified_in_the_middle() {
    let server = XServer::start(64, 48);
    let mut projector = open(&X11Spec { magnify: 5, ..spec(&server, [8, 6]) }).expect("the server is there");
    let frame =
        Frame::new(Resolution::new(8, 6), 1, (0..48).map(|at| 5 * at + 3).collect()).expect("48 levels");
    projector.show(&frame).expect("it is on screen");
    let seen = server.pixels([12, 9, 40, 30]);
    for (at, &pixel) in seen.iter().enumerate() {
        let (x, y) = (at % 40 / 5, at / 40 / 5);
        assert_eq!(pixel, [(5 * (8 * y + x) + 3) as u8; 3], "pixel {at}");
    }
    assert!(server.pixels([0, 0, 64, 9]).iter().all(|&pixel| pixel == [0; 3]));
}

#[test]
fn confirmations_follow_each_other_and_say_what_they_took() {
    let server = XServer::start(160, 120);
    let mut projector = open(&spec(&server, [128, 96])).expect("the server is there");
    let size = Resolution::new(128, 96);
    let mut last = 0.0;
    let mut sums = [0.0; 4];
    for level in 0..40 {
        let shown = projector.show(&Frame::filled(size, 1, 6 * level)).expect("it is on screen");
        let times = projector.times();
        let parts = [times.draw, times.present, times.settle, times.verify];
        let whole: f64 = parts.iter().sum();
        assert!(shown.at >= last + whole, "frame {level}: {} after {last}, which took {whole}", shown.at);
        // The refresh after the confirmed one: it cannot have come at once every time.
        last = shown.at;
        sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
    }
    let [draw, present, settle, verify] = sums.map(|sum| 1e3 * sum / 40.0);
    println!(
        "128x96: draw {draw:.2} ms, present {present:.2} ms, settle {settle:.2} ms, verify {verify:.2} ms"
    );
    // Refreshes are waited for: on average at least half of one.
    assert!(settle > 4.0, "{settle} ms");
}
