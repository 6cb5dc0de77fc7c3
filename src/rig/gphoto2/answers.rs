//! The output of `gphoto2`, parsed.

use super::speed::seconds;

/// A still camera that `gphoto2` found.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FoundStillCamera {
    /// Its name in `gphoto2`; `model` in a rig file.
    pub model: String,
    /// Its port, e.g. `usb:001,005`, which changes when the camera is switched off and on.
    pub port: String,
}

/// One of a camera's settings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Setting {
    pub(super) is_read_only: bool,
    /// The current value.
    pub(super) current: String,
    /// The possible values; empty: any value.
    pub(super) choices: Vec<String>,
}

/// Parses the cameras that `gphoto2 --auto-detect` prints: a heading, a line of dashes, and for each camera a line with its model and
/// its port, separated by spaces.
pub(super) fn cameras(answer: &[u8]) -> Vec<FoundStillCamera> {
    let text = String::from_utf8_lossy(answer);
    let rows = text.lines().skip_while(|line| !line.starts_with("---")).skip(1);
    let camera = |line: &str| {
        // A port contains no spaces; a model may.
        let (model, port) = line.trim_end().rsplit_once(' ')?;
        let model = model.trim();
        (!model.is_empty() && port.contains(':'))
            .then(|| FoundStillCamera { model: model.into(), port: port.into() })
    };
    rows.filter_map(camera).collect()
}

/// Parses the names of settings that `gphoto2 --list-config` prints: the last parts of the paths, one path on each line.
pub(super) fn names(answer: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(answer);
    let paths = text.lines().filter(|line| line.starts_with('/'));
    paths.filter_map(|path| Some(path.trim_end().rsplit_once('/')?.1.to_owned())).collect()
}

/// Parses the setting that `gphoto2 --get-config NAME` prints. `None`: the output is something else.
pub(super) fn setting(answer: &[u8]) -> Option<Setting> {
    let text = String::from_utf8_lossy(answer);
    let of = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)).map(str::trim);
    let choices = text.lines().filter_map(|line| line.strip_prefix("Choice: "));
    Some(Setting {
        is_read_only: of("Readonly:").is_some_and(|value| value == "1"),
        current: of("Current:")?.to_owned(),
        // Each line has a number and the choice.
        choices: choices.filter_map(|line| Some(line.split_once(' ')?.1.trim().to_owned())).collect(),
    })
}

impl Setting {
    /// The shutter speed whose ratio to `exposure` (in seconds) is nearest to 1: the camera's name for it, and its seconds. `stops` is
    /// that of the rig file.
    pub(super) fn nearest_speed(&self, exposure: f64, stops: Option<u32>) -> Option<(&str, f64)> {
        let speeds =
            self.choices.iter().filter_map(|choice| Some((choice.as_str(), seconds(choice, stops)?)));
        let distance = |speed: f64| (speed / exposure).ln().abs();
        speeds.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read_from_the_table() {
        let answer = b"Model                          Port                                            \n\
            ----------------------------------------------------------\n\
            Canon EOS 5D Mark II           usb:001,005     \n\
            Nikon DSC D700 (PTP mode)      usb:002,011\n";
        let found = cameras(answer);
        assert_eq!(
            found[0],
            FoundStillCamera { model: "Canon EOS 5D Mark II".into(), port: "usb:001,005".into() }
        );
        assert_eq!(found[1].model, "Nikon DSC D700 (PTP mode)");
        assert_eq!(found.len(), 2);
        assert_eq!(cameras(b"Model  Port\n-----\n"), []);
        assert_eq!(cameras(b"\xFF\xFE what is this"), []);
    }

    #[test]
    fn settings_have_choices() {
        assert_eq!(
            names(b"/main/imgsettings/iso\n/main/capturesettings/shutterspeed\nnoise\n"),
            ["iso", "shutterspeed"]
        );
        let answer =
            b"Label: Shutter Speed\nReadonly: 0\nType: RADIO\nCurrent: 1/60\nChoice: 0 bulb\nChoice: 1 30\n\
            Choice: 2 1/60\nChoice: 3 1/4000\nEND\n";
        let found = setting(answer).expect("it is one");
        assert_eq!((found.is_read_only, found.current.as_str()), (false, "1/60"));
        assert_eq!(found.choices, ["bulb", "30", "1/60", "1/4000"]);
        assert_eq!(found.nearest_speed(0.02, None), Some(("1/60", 1.0 / 60.0)));
        assert_eq!(found.nearest_speed(0.02, Some(3)), Some(("1/60", 1.0 / 64.0)));
        assert_eq!(setting(b"*** Error ***\n"), None);
        let spaced = setting(b"Readonly: 1\nCurrent: NEF (Raw)\nChoice: 0 NEF (Raw)\n").expect("it is one");
        assert!(spaced.is_read_only && spaced.choices == ["NEF (Raw)"]);
    }
}
