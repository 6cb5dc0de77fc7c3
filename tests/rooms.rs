//! The rooms of the library depend downwards only: the order that `src/lib.rs` states is the order that the sources hold.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The order in `src/lib.rs`, from the top room to the bottom one: the lines between its marks, `room → rooms below`.
fn stated() -> Vec<(String, BTreeSet<String>)> {
    let text = std::fs::read_to_string(root().join("src/lib.rs")).expect("the crate has a root");
    let lines = text.lines().skip_while(|line| !line.contains("rooms: begin"));
    let lines = lines.skip(1).take_while(|line| !line.contains("rooms: end"));
    let rooms = lines.filter_map(|line| {
        let (room, below) = line.trim_start_matches("//!").split_once('→')?;
        let below = below.split(',').map(|room| room.trim().to_owned());
        Some((room.trim().to_owned(), below.filter(|room| !room.is_empty()).collect()))
    });
    rooms.collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every `crate::room` that the sources of a room name, in code and not in comments.
fn imported(folder: &Path, room: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut files = vec![folder.join("src").join(room), folder.join(format!("src/{room}.rs"))];
    while let Some(path) = files.pop() {
        if path.is_dir() {
            let entries = std::fs::read_dir(&path).expect("sources can be read");
            files.extend(entries.map(|entry| entry.expect("an entry").path()));
        } else if path.extension().is_some_and(|extension| extension == "rs") && path.is_file() {
            let text = std::fs::read_to_string(&path).expect("sources are text");
            let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
            for line in code {
                for (at, _) in line.match_indices("crate::") {
                    let name: String =
                        line[at + 7..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect();
                    found.insert(name);
                }
            }
        }
    }
    found.remove(room);
    found
}

#[test]
fn rooms_depend_downwards_only_and_as_the_crate_says() {
    let stated = stated();
    let order: BTreeMap<&str, usize> =
        stated.iter().enumerate().map(|(place, (room, _))| (room.as_str(), place)).collect();
    let modules: BTreeSet<String> = std::fs::read_dir(root().join("src"))
        .expect("sources can be read")
        .map(|entry| entry.expect("an entry").path())
        .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
        .filter(|name| !["lib", "main"].contains(&name.as_str()))
        .collect();
    assert_eq!(modules, order.keys().map(|room| (*room).to_owned()).collect(), "every room is stated");
    for (room, below) in &stated {
        let found: BTreeSet<String> =
            imported(root(), room).into_iter().filter(|name| order.contains_key(name.as_str())).collect();
        assert_eq!(&found, below, "the rooms that `{room}` imports (left) are those that src/lib.rs states");
        for import in &found {
            assert!(
                order[import.as_str()] > order[room.as_str()],
                "`{room}` imports `{import}`, which is above it"
            );
        }
    }
}
