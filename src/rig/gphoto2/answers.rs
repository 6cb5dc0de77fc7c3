//! Parsers for the output of `gphoto2` and of the decoder: cameras, settings, shutter speeds, and gray pictures.

/// A still camera that `gphoto2` found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FoundStillCamera {
    /// The name in `gphoto2`, which is `model` in a rig file.
    pub(crate) model: String,
    /// The port, for example `usb:001,005`. It changes when the camera is switched off and on.
    pub(crate) port: String,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    pub(crate) is_read_only: bool,
    pub(crate) current: String,
    /// The possible values. An empty list means that every value is possible.
    pub(crate) choices: Vec<String>,
}

/// Parses the list of cameras that `gphoto2 --auto-detect` prints. The output has a heading, a line of dashes, and a line for each camera
/// with its model and port, separated by spaces.
pub(crate) fn cameras(answer: &[u8]) -> Vec<FoundStillCamera> {
    let text = String::from_utf8_lossy(answer);
    let rows = text.lines().skip_while(|line| !line.starts_with("---")).skip(1);
    let camera = |line: &str| {
        // A port contains no spaces, but a model may.
        let (model, port) = line.trim_end().rsplit_once(' ')?;
        let model = model.trim();
        (!model.is_empty() && port.contains(':'))
            .then(|| FoundStillCamera { model: model.into(), port: port.into() })
    };
    rows.filter_map(camera).collect()
}

/// Parses the names of settings that `gphoto2 --list-config` prints. Each line is a path, and the name is its last part.
pub(crate) fn names(answer: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(answer);
    let paths = text.lines().filter(|line| line.starts_with('/'));
    paths.filter_map(|path| Some(path.trim_end().rsplit_once('/')?.1.to_owned())).collect()
}

/// Parses the setting that `gphoto2 --get-config NAME` prints. `None`: the output has another form.
pub(crate) fn setting(answer: &[u8]) -> Option<Setting> {
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
    /// The camera's name of the shutter speed whose ratio to `exposure` (in seconds) is nearest to 1, and the speed in seconds. `stops` is
    /// the value of this key in the rig file.
    pub(crate) fn nearest_speed(&self, exposure: f64, stops: Option<u32>) -> Option<(&str, f64)> {
        let speeds =
            self.choices.iter().filter_map(|choice| Some((choice.as_str(), seconds(choice, stops)?)));
        let distance = |speed: f64| (speed / exposure).ln().abs();
        speeds.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))
    }
}

/// The exposure in seconds of a shutter speed such as `1/200`, `0.5`, `30`, `1.3s`, `1/1.3` or `0"4`. `None`: the text is not a time, for
/// example `bulb`.
///
/// Cameras use round numbers as names for powers of a root of 2, for example 1/60 for 1/64 s. With `stops` steps per doubling, the result
/// is the nearest power of `2^(1/stops)`.
pub(crate) fn seconds(speed: &str, stops: Option<u32>) -> Option<f64> {
    let speed = speed.trim().trim_end_matches(['s', '"']).trim_end().replace('"', ".");
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let said = match speed.split_once('/') {
        Some((above, below)) => number(above)? / number(below)?,
        None => number(&speed)?,
    };
    let said = Some(said).filter(|said| said.is_finite() && *said > 0.0)?;
    let Some(stops) = stops.map(f64::from) else { return Some(said) };
    Some(((said.log2() * stops).round() / stops).exp2())
}

#[derive(Debug, PartialEq)]
pub(crate) struct Gray {
    pub(crate) size: [usize; 2],
    pub(crate) counts: Vec<u16>,
}

/// Reads a PGM (`P5`). The file has width, height and the highest count as text (comments may separate them), one white-space character,
/// and the counts. A count has one byte, or two bytes (high byte first) if the highest count is 256 or more. `None`: the bytes are invalid
/// or end too early.
pub(crate) fn read_pgm(bytes: &[u8]) -> Option<Gray> {
    let mut rest = bytes.strip_prefix(b"P5")?;
    let mut next = || -> Option<usize> {
        rest = skipped(rest)?;
        let length = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (digits, after) = rest.split_at(length);
        rest = after;
        std::str::from_utf8(digits).ok()?.parse().ok()
    };
    let (size, highest) = ([next()?, next()?], next()?);
    let (white, body) = rest.split_first()?;
    let pixels = size[0].checked_mul(size[1])?;
    if !white.is_ascii_whitespace() || !(1..=65535).contains(&highest) || pixels == 0 {
        return None;
    }
    let counts: Vec<u16> = if highest < 256 {
        body.get(..pixels)?.iter().map(|&byte| u16::from(byte)).collect()
    } else {
        let body = body.get(..pixels.checked_mul(2)?)?;
        body.as_chunks::<2>().0.iter().map(|&pair| u16::from_be_bytes(pair)).collect()
    };
    Some(Gray { size, counts })
}

/// Skips white space and comments. `None`: there is no white space.
fn skipped(mut bytes: &[u8]) -> Option<&[u8]> {
    let before = bytes.len();
    loop {
        match bytes.first()? {
            b'#' => {
                let end = bytes.iter().position(|&byte| byte == b'\n')?;
                bytes = &bytes[end..];
            }
            byte if byte.is_ascii_whitespace() => bytes = &bytes[1..],
            _ => return (bytes.len() < before).then_some(bytes),
        }
    }
}

impl Gray {
    /// The counts of the part with this size and offset. `None`: the part does not fit.
    pub(crate) fn part(&self, [width, height]: [usize; 2], [x, y]: [usize; 2]) -> Option<Vec<u16>> {
        if x + width > self.size[0] || y + height > self.size[1] {
            return None;
        }
        let rows = (y..y + height).map(|row| row * self.size[0] + x);
        Some(rows.flat_map(|start| &self.counts[start..start + width]).copied().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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

    #[test]
    fn speeds_are_read_in_every_notation() {
        for (speed, expected) in [
            ("1/200", Some(0.005)),
            ("0.5", Some(0.5)),
            ("30", Some(30.0)),
            ("1.3s", Some(1.3)),
            ("0.0166s", Some(0.0166)),
            ("10/13", Some(10.0 / 13.0)),
            ("1/1.3", Some(1.0 / 1.3)),
            ("0\"4", Some(0.4)),
            ("15\"", Some(15.0)),
            ("bulb", None),
            ("Time", None),
            ("0", None),
            ("1/0", None),
            ("-1", None),
            ("", None),
        ] {
            assert_eq!(seconds(speed, None), expected, "{speed}");
        }
    }

    #[test]
    fn round_numbers_are_replaced_by_powers_of_a_root_of_two() {
        for (speed, stops, power) in [
            ("1/8000", 3, -13.0),
            ("1/60", 3, -6.0),
            ("1/15", 3, -4.0),
            ("1/13", 3, -11.0 / 3.0),
            ("1/10", 3, -10.0 / 3.0),
            ("0.8", 3, -1.0 / 3.0),
            ("1.3", 3, 1.0 / 3.0),
            ("20", 3, 13.0 / 3.0),
            ("30", 3, 5.0),
            ("1/45", 2, -5.5),
            ("1/90", 2, -6.5),
        ] {
            let found = seconds(speed, Some(stops)).expect("it is a time");
            assert!((found.log2() - power).abs() < 1e-12, "{speed}: {found}");
        }
    }

    #[test]
    fn a_picture_is_read_count_by_count() {
        let wide = b"P5\n# by hand\n2 2 # and here\n65535\n\x00\x01\x3f\xff\xff\xff\x12\x34";
        let found = read_pgm(wide).expect("it is one");
        assert_eq!(found, Gray { size: [2, 2], counts: vec![1, 16383, 65535, 0x1234] });
        // A count may have the byte of a white-space character. Counts are not scaled to the highest count.
        assert_eq!(read_pgm(b"P5 3 1 15\n\n\x0f\x01").expect("it is one").counts, [10, 15, 1]);
        assert_eq!(found.part([1, 2], [1, 0]), Some(vec![16383, 0x1234]));
        assert_eq!(found.part([2, 1], [1, 0]), None);
    }

    #[test]
    fn other_formats_and_truncated_files_are_refused() {
        for bytes in [
            &b"P6\n1 1\n255\n\x00\x00\x00"[..],
            b"P5\n2 2\n65535\n\x00\x01\x00",
            b"P5\n2 2\n70000\n\x00\x01\x00\x01\x00\x01\x00\x01",
            b"P5\n0 2\n255\n",
            b"P5\n99999999999 99999999999\n65535\n",
            b"P512 2 255\n",
            b"II*\x00",
            b"",
        ] {
            assert_eq!(read_pgm(bytes), None, "{bytes:?}");
        }
    }

    proptest! {
        #[test]
        fn written_counts_are_read_back(width in 1_usize..9, counts in prop::collection::vec(any::<u16>(), 1..60)) {
            let height = counts.len() / width;
            prop_assume!(height > 0);
            let mut bytes = format!("P5 {width} {height} 65535\n").into_bytes();
            let counts = &counts[..width * height];
            counts.iter().for_each(|count| bytes.extend(count.to_be_bytes()));
            prop_assert_eq!(read_pgm(&bytes), Some(Gray { size: [width, height], counts: counts.to_vec() }));
        }

        #[test]
        fn random_bytes_never_cause_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let _ = read_pgm(&[b"P5 ".as_slice(), &bytes].concat());
        }
    }
}
