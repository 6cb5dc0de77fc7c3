//! Large files that repeat the parts of small ones: where a reader's work grows with the square of a file's length, it does not end in time.

use std::io::Write;

use serde_json::Value;

/// The length of a large file in bytes, about.
const LENGTH: usize = 256 << 10;

/// Enough of the parts `part(0)`, `part(1)`, … for a large file.
fn repeated(part: impl Fn(usize) -> Vec<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in 0.. {
        if bytes.len() >= LENGTH {
            break;
        }
        bytes.extend(part(number));
    }
    bytes
}

/// Large files made of a seed: its parts repeated in their place.
pub fn of(seed: &[u8]) -> Vec<Vec<u8>> {
    let whole = repeated(|_| seed.to_vec());
    let parts = match (serde_json::from_slice(seed), std::str::from_utf8(seed)) {
        (Ok(json), _) => of_json(&json),
        (_, Ok(text)) => of_lines(text),
        _ => of_pieces(seed),
    };
    parts.into_iter().chain([whole]).collect()
}

/// A sixteenth of the seed is repeated.
fn of_pieces(seed: &[u8]) -> Vec<Vec<u8>> {
    let piece = seed.len().div_ceil(16).max(1);
    let ends = (0..seed.len()).step_by(piece).map(|from| (from, seed.len().min(from + piece)));
    ends.map(|(from, to)| [&seed[..from], &repeated(|_| seed[from..to].to_vec()), &seed[to..]].concat())
        .collect()
}

/// A line is repeated, as it is and with a number behind it; and so are the words of a line.
fn of_lines(text: &str) -> Vec<Vec<u8>> {
    let lines: Vec<&str> = text.lines().collect();
    let mut seen = std::collections::HashSet::new();
    let mut files = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let (first, rest) = line.split_once(' ').unwrap_or((line, ""));
        if !seen.insert(first) {
            continue;
        }
        let [before, after] = [&lines[..at], &lines[at + 1..]].map(|lines| lines.join("\n"));
        let mut add = |middle: Vec<u8>| {
            files.push([before.as_bytes(), b"\n", &middle, b"\n", after.as_bytes()].concat());
        };
        add(repeated(|_| format!("{line}\n").into()));
        add(repeated(|number| format!("{line}{number}\n").into()));
        add([first.as_bytes(), &repeated(|_| format!(" {rest}").into())].concat());
        add([line.as_bytes(), &repeated(|number| format!(", {number}").into())].concat());
    }
    files
}

/// The elements of an array, or the first member of an object, are repeated.
fn of_json(json: &Value) -> Vec<Vec<u8>> {
    let mut places = Vec::new();
    note_places(json, String::new(), &mut places);
    let grown = |place: &String| {
        let mut json = json.clone();
        let size = json.pointer(place).map_or(1, |value| value.to_string().len());
        let times = LENGTH.div_ceil(size);
        match json.pointer_mut(place) {
            Some(Value::Array(elements)) => {
                *elements = std::iter::repeat_n(elements.clone(), times).flatten().collect();
            }
            Some(Value::Object(members)) => {
                let member = members.values().next().cloned().unwrap_or_default();
                members.extend((0..times).map(|number| (format!("member {number}"), member.clone())));
            }
            _ => {}
        }
        json.to_string().into_bytes()
    };
    places.iter().map(grown).collect()
}

/// Notes the place of each array and object that is not empty.
fn note_places(json: &Value, place: String, places: &mut Vec<String>) {
    let inside: Vec<(String, &Value)> = match json {
        Value::Array(elements) => {
            elements.iter().enumerate().map(|(at, value)| (at.to_string(), value)).collect()
        }
        Value::Object(members) => members.iter().map(|(name, value)| (name.clone(), value)).collect(),
        _ => return,
    };
    if !inside.is_empty() {
        places.push(place.clone());
    }
    for (name, value) in inside {
        note_places(value, format!("{place}/{name}"), places);
    }
}

/// Scenes of nodes below one another, of nodes that all have one mesh, and of animated skeletons.
pub fn gltf(seed: &[u8]) -> Vec<Vec<u8>> {
    let Ok(json) = serde_json::from_slice::<Value>(seed) else { return Vec::new() };
    let nodes = |node: fn(usize, usize) -> Value| {
        let mut json = json.clone();
        let count = LENGTH / 64;
        let first = json["nodes"].as_array().map_or(0, Vec::len);
        let nodes = (0..count).map(|at| node(first + at, first + count));
        if let Some(all) = json["nodes"].as_array_mut() {
            all.extend(nodes);
        }
        json.to_string().into_bytes()
    };
    let chain = |at: usize, end: usize| match at + 1 < end {
        true => serde_json::json!({ "mesh": 0, "children": [at + 1] }),
        false => serde_json::json!({ "mesh": 0 }),
    };
    let jointed = |at: usize, _: usize| serde_json::json!({ "mesh": 0, "name": "a", "skin": at % 2 });
    vec![nodes(chain), nodes(jointed)]
}

/// Faces with very many corners: of few points, along a line, on a spiral, and zigzag.
pub fn obj() -> Vec<Vec<u8>> {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf ";
    let face = |corners: &str| [square.as_bytes(), &repeated(|_| corners.into())].concat();
    let around = |point: fn(f64) -> [f64; 2]| {
        let line = |number: usize| {
            let [x, y] = point(number as f64);
            format!("v {x:.4} {y:.4} 0\n").into_bytes()
        };
        let vertices = repeated(line);
        let count = vertices.iter().filter(|&&byte| byte == b'\n').count();
        let face: String = (1..=count).map(|corner| format!(" {corner}")).collect();
        [&vertices[..], b"f", face.as_bytes(), b"\n"].concat()
    };
    let mut files: Vec<_> =
        ["1 2 3 4 ", "1 2 3 ", "1 3 2 4 ", "1 2 3 4 1 4 3 2 ", "1 2 1 3 2 4 "].map(face).into();
    files.push(around(|at| [(0.3 * at).cos() * (1.0 + at / 1e4), (0.3 * at).sin() * (1.0 + at / 1e4)]));
    files.push(around(|at| [(2.4 * at).cos(), (2.4 * at).sin()]));
    files.push(around(|at| [at, at % 2.0]));
    files.push(around(|at| [at % 3.0, (at * 0.618).fract()]));
    files
}

/// An archive of a matrix with very many members.
pub fn npz() -> Vec<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for number in 0..LENGTH / 128 {
        archive
            .start_file(format!("{number}.npy"), zip::write::SimpleFileOptions::default())
            .and_then(|()| Ok(archive.write_all(b"\x93NUMPY")?))
            .expect("memory can be written");
    }
    vec![archive.finish().expect("memory can be written").into_inner()]
}

/// A picture with very many notes.
pub fn png() -> Vec<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Grayscale);
    for number in 0..LENGTH / 16 {
        encoder.add_text_chunk(format!("a{number}"), String::new()).expect("it is a keyword");
    }
    let mut writer = encoder.write_header().expect("memory can be written");
    writer.write_image_data(&[7]).expect("memory can be written");
    writer.finish().expect("memory can be written");
    vec![bytes]
}
