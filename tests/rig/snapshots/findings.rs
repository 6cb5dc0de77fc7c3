//! The findings of checks of benches, each with one imperfection.

use std::fmt::Write;

use krylux::bench::rig_check;
use krylux::measure::Calibration;
use krylux::rig::{Iris, Pulse, Splitter, VirtualRig};

use super::bench::{calibrated, frames, quick, realistic};
use super::compare;
use crate::rig::calibration::imperfections::rig_file;

fn found(rig: &VirtualRig, known: Option<&Calibration>) -> String {
    let file = rig_file(rig);
    let mut frames = frames(rig, file.settle(known));
    let findings = rig_check::faults(&file, known, &mut frames).expect("nothing interrupts it");
    findings.iter().map(|finding| format!("{finding}\n")).collect()
}

#[test]
fn of_benches_with_one_imperfection_each() {
    let with = |imperfection: fn(&mut VirtualRig)| {
        let mut rig = realistic();
        rig.camera.gamma = None;
        imperfection(&mut rig);
        rig
    };
    let benches: [(&str, VirtualRig); 12] = [
        ("as it is", with(|_| {})),
        ("iris", with(|rig| rig.projector.iris = Iris { dimming: 0.2, time: 0.0 })),
        ("slow iris", with(|rig| rig.projector.iris = Iris { dimming: 0.3, time: 1.0 })),
        ("limited range", with(|rig| rig.projector.limited_range = true)),
        ("stray light", with(|rig| rig.splitter = Splitter { stray: 0.06, ..Splitter::default() })),
        (
            "ghost",
            with(|rig| {
                rig.splitter = Splitter { ghost: 0.05, ghost_shift: [5.0, 2.0], ..Splitter::default() }
            }),
        ),
        ("pulses", with(|rig| rig.projector.pulse = Pulse { period: 1.0 / 120.0, duty: 0.5, wheel: false })),
        ("shutter", with(|rig| rig.camera.rolling_shutter = 0.015)),
        ("overscan", with(|rig| rig.projector.overscan = 0.05)),
        ("blur", with(|rig| rig.camera.blur = 1.5)),
        ("saturation", with(|rig| rig.camera.white_fill = 1.4)),
        ("darkness", with(|rig| rig.camera.white_fill = 0.002)),
    ];
    let (calibration, _) = calibrated(&benches[0].1, &quick());
    let mut text = String::new();
    for (name, rig) in &benches {
        for (known, word) in [(None, "not calibrated"), (Some(&calibration), "calibrated")] {
            writeln!(text, "== {name}, {word}\n{}", found(rig, known)).expect("a string takes everything");
        }
    }
    compare("findings", &text);
}
