//! Tests with random trees of links and pipes. Nothing outside of the top folder is read or changed, and no call waits.

use std::os::unix::fs::symlink;
use std::path::PathBuf;

use proptest::prelude::*;
use rustix::fs::{CWD, FileType, Mode, mknodat};

use super::system::{any_system, unix};
use super::*;
use crate::Error;

const SECRET: &str = "what the user keeps elsewhere";

#[derive(Clone, Copy, Debug)]
enum Thing {
    File,
    Folder,
    Pipe,
    LinkToFile,
    LinkToFolder,
    LinkToNothing,
}

fn thing() -> impl Strategy<Value = Thing> {
    use Thing::{File, Folder, LinkToFile, LinkToFolder, LinkToNothing, Pipe};
    prop::sample::select(vec![File, Folder, Folder, Folder, Pipe, LinkToFile, LinkToFolder, LinkToNothing])
}

/// A folder of the user, which contains a run's folder with random things in `a`, `a/a`, `b` and so on.
struct Tree {
    folder: tempfile::TempDir,
}

impl Tree {
    fn new(things: &[(usize, Thing)]) -> io::Result<Self> {
        let tree = Self { folder: tempfile::tempdir()? };
        let outside = tree.at("outside");
        fs::create_dir_all(outside.join("a/a"))?;
        for name in ["a/a/a", "a/b", "secret"] {
            fs::write(outside.join(name), SECRET)?;
        }
        fs::create_dir(tree.at("run"))?;
        for &(place, thing) in things {
            let path = tree.place(place);
            if path.ancestors().skip(1).any(Path::is_symlink) {
                continue;
            }
            // The call fails if the parent is not a folder, or if something already exists. Such failures are ignored.
            let _ = match thing {
                Thing::File => fs::OpenOptions::new().write(true).create_new(true).open(&path).map(drop),
                Thing::Folder => fs::create_dir(&path),
                Thing::Pipe => {
                    mknodat(CWD, &path, FileType::Fifo, Mode::from_raw_mode(0o600), 0).map_err(Into::into)
                }
                Thing::LinkToFile => symlink(outside.join("secret"), &path),
                Thing::LinkToFolder => symlink(&outside, &path),
                Thing::LinkToNothing => symlink(outside.join("new"), &path),
            };
        }
        Ok(tree)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// One of 14 paths, up to three levels deep.
    fn place(&self, number: usize) -> PathBuf {
        let names = [
            "a", "b", "a/a", "a/b", "b/a", "b/b", "a/a/a", "a/a/b", "a/b/a", "a/b/b", "b/a/a", "b/a/b",
            "b/b/a",
        ];
        self.at("run").join(names[number % names.len()])
    }

    fn outside(&self) -> Vec<(PathBuf, Option<Vec<u8>>)> {
        let (mut found, mut folders) = (Vec::new(), vec![self.at("outside")]);
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).expect("it is ours").flatten() {
                if entry.path().is_dir() {
                    folders.push(entry.path());
                }
                found.push((entry.path(), fs::read(entry.path()).ok()));
            }
        }
        found.sort();
        found
    }
}

proptest! {
    /// Links above the top folder belong to the user. Below it, no link is followed, and only regular files are accepted.
    #[test]
    fn nothing_outside_a_top_is_read_or_written(
        things in prop::collection::vec((0..13_usize, thing()), 1..14),
        tries in prop::collection::vec((0..13_usize, 0..7_u8), 1..12),
    ) {
        let tree = Tree::new(&things)?;
        symlink(tree.at("run"), tree.at("link"))?;
        follow_no_links_below(&tree.at("run"));
        follow_no_links_below(&tree.at("link"));
        let before = tree.outside();
        for (index, (place, how)) in tries.into_iter().enumerate() {
            let mut path = tree.place(place);
            if index % 2 == 1 {
                path = tree.at("link").join(path.strip_prefix(tree.at("run")).expect("it is below"));
            }
            let read = match how {
                0 => read_text(&path),
                1 => read(&path).map(|bytes| String::from_utf8_lossy(&bytes).into_owned()),
                2 => atomic::write_bytes(&path, b"new").map(|()| String::new()),
                3 => open_to_change(&path).and_then(|file| file.set_len(0).map_err(Error::writing(&path))).map(|()| String::new()),
                4 => open_or_make(&path).map_err(Error::writing(&path)).map(|_| String::new()),
                5 => make_folder(&path).map(|()| String::new()),
                _ => atomic::check_writable(&path).map(|()| String::new()),
            };
            prop_assert!(read.is_err() || read.is_ok_and(|text| text != SECRET), "{}", path.display());
            prop_assert_eq!(&tree.outside(), &before, "{} by {}", path.display(), how);
        }
    }

    /// The code for systems without folder descriptors makes the same decisions as the code for Linux and macOS.
    #[test]
    fn all_systems_decide_alike(things in prop::collection::vec((0..13_usize, thing()), 1..14), place in 0..13_usize) {
        macro_rules! decide {
            ($system:ident, $tree:expr, $access:expr) => {{
                let path = $tree.place(place);
                let parts: Vec<PathBuf> =
                    path.strip_prefix($tree.at("run")).expect("it is below").iter().map(PathBuf::from).collect();
                let (name, above) = parts.split_last().expect("it has a name");
                let folder = above
                    .iter()
                    .try_fold($system::Folder::open(&$tree.at("run"))?, |folder, part| folder.enter(part));
                folder
                    .and_then(|folder| {
                        let kind = folder.kind(name, false);
                        // `Spot` never opens a pipe.
                        let is_open = !matches!(kind, Ok(FileKind::Other)) && folder.open_file(name, $access, false).is_ok();
                        Ok((kind.map_err(|error| error.kind()), is_open))
                    })
                    .map_err(|error| error.kind())
            }};
        }
        for access in [Access::Read, Access::Change, Access::Make, Access::New] {
            let trees = [Tree::new(&things)?, Tree::new(&things)?];
            let found = [decide!(unix, trees[0], access), decide!(any_system, trees[1], access)];
            // The results may differ only if the last part is a link: one of the two opens the link, and then refuses it as a link.
            if !matches!(found[0], Ok((Ok(FileKind::Link), _))) {
                prop_assert_eq!(&found[0], &found[1], "{:?}", trees[0].place(place));
            }
        }
    }
}

#[test]
fn a_path_with_dots_is_the_users() {
    let tree =
        Tree::new(&[(0, Thing::Folder), (1, Thing::LinkToFile)]).expect("a temporary folder can be made");
    follow_no_links_below(&tree.at("run"));
    assert_eq!(read_text(&tree.at("run").join("a/../b")).ok().as_deref(), Some(SECRET));
    let refused = read_text(&tree.at("run").join("b")).expect_err("it is a link").to_string();
    assert!(refused.contains("no link is followed") && refused.contains("run/b"), "{refused}");
}

#[test]
fn only_the_user_and_root_are_no_strangers() {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_pcg::Pcg64::seed_from_u64(1);
    let mut counts = [0; 2];
    for _ in 0..20_000 {
        let users = [0, 1000, 1001, 65534];
        let [user, owner] = [0; 2].map(|_| users[random.random_range(0..users.len())]);
        let mode = random.random_range(0..0o10000);
        // The owner can change the mode, and thereby the file. For all other users, the bits of the mode decide.
        let may_write = |who: u32| who == owner || mode & 0o020 != 0 || mode & 0o002 != 0;
        let is_safe = users.into_iter().filter(|who| ![0, user].contains(who)).all(|who| !may_write(who));
        assert_eq!(stranger_of(user, (owner, mode)).is_none(), is_safe, "{user} {owner} {mode:o}");
        counts[usize::from(is_safe)] += 1;
    }
    assert!(counts[0] > 1000 && counts[1] > 1000, "{counts:?}");
    let sudo = stranger_of(0, (1000, 0o644)).expect("under sudo the file is not root's");
    assert!(sudo.contains("user 1000") && sudo.contains("runs as user 0"), "{sudo}");
}
