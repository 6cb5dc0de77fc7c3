//! From levels to the light on the sensor.

use krylux::measure::Shots;

use super::support::{live, rig, shot};

#[test]
fn an_ideal_rig_counts_the_light_of_each_level() {
    let rig = rig(5, 4);
    let mut live = live(&rig, 0.0, 1);
    for level in [0, 1, 100, 255] {
        let frame = live.shoot(&shot(&rig, level, 0.1, 0)).expect("nothing goes wrong");
        // White fills half of the range in 0.1 s.
        let expected = (0.5 * 65535.0 * f64::from(level) / 255.0).round() as u16;
        assert!(
            frame.counts.iter().all(|&count| count.abs_diff(expected) <= 1),
            "{level}: {:?}",
            frame.counts
        );
        assert_eq!((frame.resolution, frame.exposure), (rig.scene.size(), 0.1));
    }
    assert!(live.shoot(&shot(&rig, 256, 0.1, 0)).is_err(), "a level that it cannot show");
}
