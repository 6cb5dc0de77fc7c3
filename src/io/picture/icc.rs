//! Colour profiles (ICC.1:2022) that differ from sRGB at most in their curve.

use super::curve::Curve;

/// Red, green and blue of Rec. 709, adapted to the white D50 of profiles, as XYZ.
const COLORANTS: [(&[u8; 4], [f32; 3]); 3] = [
    (b"rXYZ", [0.4361, 0.2225, 0.0139]),
    (b"gXYZ", [0.3851, 0.7169, 0.0971]),
    (b"bXYZ", [0.1431, 0.0606, 0.7141]),
];

/// Profiles of sRGB differ by up to 0.001 in these numbers. The nearest other primaries in use (EBU) differ by more than 0.01.
const TOLERANCE: f32 = 0.003;

/// The curve of a profile. The primaries of a `color` picture must be those of sRGB.
///
/// # Errors
/// The property of the profile that no curve can express, with the name of the profile.
pub(super) fn curve(profile: &[u8], color: bool) -> Result<Curve, String> {
    let found = match profile.get(16..20) {
        Some(b"RGB ") => rgb(profile, color),
        Some(b"GRAY") if !color => of_tag(profile, b"kTRC"),
        Some(space) => Err(format!("is for {} pictures", String::from_utf8_lossy(space).trim_end())),
        None => Err("is malformed".into()),
    };
    found.map_err(|fault| format!("its colour profile \"{}\" {fault}", name(profile)))
}

fn rgb(profile: &[u8], color: bool) -> Result<Curve, String> {
    if tag(profile, b"A2B0").is_some() {
        return Err("maps colours by a table".into());
    }
    for (name, srgb) in COLORANTS.iter().filter(|_| color) {
        let colorant = tag(profile, name).ok_or("has no primaries")?;
        let near = |(at, of): (usize, &f32)| {
            (fixed(colorant, 8 + 4 * at).unwrap_or(f32::NAN) - of).abs() < TOLERANCE
        };
        if !srgb.iter().enumerate().all(near) {
            return Err("has other primaries than sRGB".into());
        }
    }
    let red = tag(profile, b"rTRC");
    if [b"gTRC", b"bTRC"].iter().any(|name| tag(profile, name) != red) {
        return Err("has a curve of its own for each channel".into());
    }
    of_tag(profile, b"rTRC")
}

fn of_tag(profile: &[u8], name: &[u8; 4]) -> Result<Curve, String> {
    let data = tag(profile, name).ok_or("has no curve")?;
    parse(data).ok_or_else(|| "has a curve that cannot be read".into())
}

/// A curve of the type `curv` or `para`.
fn parse(data: &[u8]) -> Option<Curve> {
    let halfword = |at: usize| Some(u16::from_be_bytes(data.get(at..at + 2)?.try_into().ok()?));
    match data.get(..4)? {
        b"curv" => match word(data, 8)? {
            0 => Some(Curve::LINEAR),
            1 => Some(Curve::power(f32::from(halfword(12)?) / 256.0)),
            count => {
                let levels = data.get(12..)?.as_chunks().0.get(..count as usize)?;
                let level = |&level: &[u8; 2]| f32::from(u16::from_be_bytes(level)) / f32::from(u16::MAX);
                Some(Curve::Table(levels.iter().map(level).collect()))
            }
        },
        b"para" => {
            let count = *[1, 3, 4, 5, 7].get(usize::from(halfword(8)?))?;
            let numbers: Option<Vec<f32>> = (0..count).map(|number| fixed(data, 12 + 4 * number)).collect();
            let (g, a, b, c, d, e, f) = match *numbers?.as_slice() {
                [g] => (g, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
                [g, a, b] => (g, a, b, 0.0, -b / a, 0.0, 0.0),
                [g, a, b, e] => (g, a, b, 0.0, -b / a, e, e),
                [g, a, b, c, d] => (g, a, b, c, d, 0.0, 0.0),
                [g, a, b, c, d, e, f] => (g, a, b, c, d, e, f),
                _ => return None,
            };
            Some(Curve::Segments { g, a, b, c, d, e, f })
        }
        _ => None,
    }
}

/// The data of a tag, with its type.
fn tag<'a>(profile: &'a [u8], name: &[u8; 4]) -> Option<&'a [u8]> {
    let entries = profile.get(132..)?.as_chunks::<12>().0.iter().take(word(profile, 128)? as usize);
    let entry = entries.into_iter().find(|entry| entry.starts_with(name))?;
    let (start, length) = (word(entry, 4)? as usize, word(entry, 8)? as usize);
    profile.get(start..start.checked_add(length)?)
}

/// The description of a profile: ASCII in version 2, UTF-16 in version 4.
fn name(profile: &[u8]) -> String {
    let text = || {
        let data = tag(profile, b"desc")?;
        if data.starts_with(b"mluc") {
            let (length, start) = (word(data, 20)? as usize, word(data, 24)? as usize);
            let units = data.get(start..start.checked_add(length)?)?.as_chunks().0.iter();
            return Some(String::from_utf16_lossy(
                &units.map(|&unit| u16::from_be_bytes(unit)).collect::<Vec<_>>(),
            ));
        }
        let text = data.get(12..12_usize.checked_add(word(data, 8)? as usize)?)?;
        Some(String::from_utf8_lossy(text).into_owned())
    };
    let text: String = text().unwrap_or_default();
    text.chars().filter(|c| !c.is_control()).take(80).collect()
}

fn word(data: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(data.get(at..at + 4)?.try_into().ok()?))
}

/// A number of the type `s15Fixed16Number`.
fn fixed(data: &[u8], at: usize) -> Option<f32> {
    Some(word(data, at)?.cast_signed() as f32 / 65536.0)
}
