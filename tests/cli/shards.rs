//! A matrix traced in shards: joined in any order it has the bits of one run; what does not belong together is refused by name.

use std::path::Path;
use std::process::Output;

use crate::common::{root, scene_path};
use crate::program::{assert_error, command, folder, inside, text};
use tempfile::TempDir;

/// A folder with a cache of its own.
struct Bench {
    folder: TempDir,
    scene: String,
    options: Vec<&'static str>,
}

impl Bench {
    fn new(scene: &Path, options: &[&'static str]) -> Self {
        Self { folder: folder(), scene: scene.display().to_string(), options: options.to_vec() }
    }

    /// The smallest scene, on which everything is refused that can be.
    fn small() -> Self {
        Self::new(&scene_path("corner"), &["--size", "12x10", "--spp", "4"])
    }

    fn path(&self, name: &str) -> String {
        inside(&self.folder, name)
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_default()
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = command(arguments);
        command.current_dir(root()).env("KRYLUX_CACHE", self.path("cache"));
        command.output().expect("the program is built with the tests")
    }

    #[track_caller]
    fn says(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        text(&output.stdout) + &text(&output.stderr)
    }

    /// Traces part `part` of `parts` into `name`, with more options.
    #[track_caller]
    fn shard_with(&self, name: &str, part: usize, parts: usize, more: &[&str]) -> String {
        let (path, of) = (self.path(name), format!("{part}/{parts}"));
        let shard = ["--shard", &of, "-o", &path];
        self.says(&[&["matrix", &self.scene], &self.options[..], more, &shard].concat())
    }

    #[track_caller]
    fn shard(&self, part: usize, parts: usize) -> String {
        let name = format!("{part}.krylux");
        self.shard_with(&name, part, parts, &[]);
        self.path(&name)
    }

    fn join(&self, shards: &[&str], name: &str) -> Output {
        let path = self.path(name);
        self.run(&[&["matrix", "join"], shards, &["-o", &path]].concat())
    }

    /// The matrix of one run on the processor, which leaves nothing in the cache.
    #[track_caller]
    fn whole(&self, name: &str, more: &[&str]) {
        let path = self.path(name);
        self.says(
            &[
                &["matrix", &self.scene],
                &self.options[..],
                more,
                &["--products", "cpu", "--no-cache", "-o", &path],
            ]
            .concat(),
        );
    }
}

/// Numbers from 1 to `count` out of their order.
fn shuffled(count: usize) -> impl Iterator<Item = usize> {
    assert!(!count.is_multiple_of(7), "7 and the count have no common divisor");
    (0..count).map(move |at| at * 7 % count + 1)
}

/// The traced cases: a coaxial rig, one with mirrors, one in colour, a projector apart, bounces apart.
fn cases() -> [(Bench, &'static [&'static str]); 5] {
    let small = ["--size", "12x10", "--spp", "4"];
    let separated = root().join("tests/reference/peer/separated.glb");
    [
        (Bench::new(&scene_path("corner"), &small), &["A.npz"]),
        (Bench::new(&scene_path("mirror"), &small), &["A.npz"]),
        (
            Bench::new(&scene_path("cornell"), &[&small[..], &["--channels", "rgb"]].concat()),
            &["A.r.npz", "A.g.npz", "A.b.npz"],
        ),
        (Bench::new(&separated, &[&small[..], &["--projector-size", "9x14"]].concat()), &["A.npz"]),
        (
            Bench::new(&scene_path("cornell"), &[&small[..], &["--split-bounces"]].concat()),
            &["A_direct.npz", "A_second.npz", "A_rest.npz"],
        ),
    ]
}

#[test]
fn sixteen_shards_in_any_order_are_the_matrix_of_one_run() {
    for (bench, files) in cases() {
        let parts: Vec<String> = shuffled(16).map(|part| bench.shard(part, 16)).collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        let output = bench.join(&parts, "A.npz");
        assert!(output.status.success(), "{}: {}", bench.scene, text(&output.stderr));
        let joined = files.iter().map(|file| bench.bytes(file)).collect::<Vec<_>>();
        files.iter().for_each(|file| std::fs::remove_file(bench.path(file)).expect("it was written"));
        bench.whole("A.npz", &[]);
        for (file, joined) in files.iter().zip(joined) {
            assert!(joined.len() > 1000, "there is something to compare");
            assert!(joined == bench.bytes(file), "{}: {file} differs", bench.scene);
        }
    }
}

#[test]
fn a_part_of_the_light_is_joined_as_it_is_traced() {
    let bench = Bench::small();
    let shards = [bench.shard(1, 2), bench.shard(2, 2)];
    for part in ["direct", "global"] {
        let (joined, whole) = (bench.path("joined.mtx"), bench.path("whole.mtx"));
        bench.says(&["matrix", "join", &shards[1], &shards[0], "--part", part, "-o", &joined]);
        bench.whole("whole.mtx", &["--part", part]);
        assert!(bench.bytes("joined.mtx") == bench.bytes("whole.mtx"), "{part}: {joined} and {whole}");
    }
}

#[test]
fn a_joined_matrix_is_in_the_cache() {
    let bench = Bench::small();
    let shards = [bench.shard(1, 3), bench.shard(3, 3), bench.shard(2, 3)];
    let shards: Vec<&str> = shards.iter().map(String::as_str).collect();
    let segment = |out: &str| {
        let out = bench.path(out);
        let verb = ["segment", &bench.scene, "--photos", "8", "--groups", "2", "--no-check", "-o", &out];
        bench.says(&[&verb[..], &bench.options].concat())
    };
    // Without the cache it would not be there.
    let path = bench.path("A.npz");
    bench.says(&[&["matrix", "join"], &shards[..], &["--no-cache", "-o", &path]].concat());
    assert!(!Path::new(&bench.path("cache")).exists());
    assert!(bench.join(&shards, "A.npz").status.success());
    assert!(segment("run").contains("from the cache"), "it is found");
}

#[test]
fn a_whole_shard_is_not_traced_again_and_anything_else_is() {
    let bench = Bench::small();
    let path = bench.shard(3, 16);
    let first = bench.bytes("3.krylux");
    assert!(bench.shard_with("3.krylux", 3, 16, &[]).contains("nothing is traced"));
    assert!(bench.bytes("3.krylux") == first, "it is left as it is");
    // Another part, another seed, and what a killed copy leaves.
    let note = bench.shard_with("3.krylux", 4, 16, &[]);
    assert!(note.contains("3.krylux is replaced: it is part 3 of 16"), "{note}");
    let note = bench.shard_with("3.krylux", 4, 16, &["--seed", "1"]);
    assert!(note.contains("its seed is 0, not 1"), "{note}");
    bench.shard_with("3.krylux", 3, 16, &[]);
    for length in [first.len() - 1, 200, 14, 0] {
        std::fs::write(&path, &first[..length]).expect("it is ours");
        let note = bench.shard_with("3.krylux", 3, 16, &[]);
        assert!(note.contains("3.krylux is replaced: the shard is cut short"), "{note}");
        assert!(contributions(&bench.bytes("3.krylux")) == contributions(&first), "it is traced again");
    }
    // A file of another kind is nobody's to replace.
    std::fs::write(&path, "a thesis").expect("it is ours");
    let output = bench.run(&["matrix", &bench.scene, "--shard", "3/16", "-o", &path]);
    assert_error(&output, &["3.krylux", "is not a shard", "-o"]);
    assert_eq!(bench.bytes("3.krylux"), b"a thesis");
}

/// A shard without its head, which holds times, and without the digest.
fn contributions(file: &[u8]) -> &[u8] {
    let lines: Vec<usize> = (0..file.len()).filter(|&at| file[at] == b'\n').take(2).collect();
    &file[lines[1]..file.len() - 32]
}

#[test]
fn shards_that_do_not_make_one_matrix_are_refused_by_name() {
    let bench = Bench::small();
    let shards = [bench.shard(1, 4), bench.shard(2, 4), bench.shard(3, 4), bench.shard(4, 4)];
    let [one, two, three, four] = shards.each_ref().map(String::as_str);
    let missing = |parts: &[&str], listed: &str| {
        assert_error(&bench.join(parts, "A.npz"), &["SHARDS", listed, "missing", "--shard"]);
    };
    missing(&[four, one, three], "part 2 of 4 is");
    missing(&[three], "parts 1, 2 and 4 of 4 are");

    let others = [
        (&["--seed", "1"][..], "its seed is 1, not 0"),
        (&["--spp", "8"], "its samples per pixel is 8, not 4"),
        (&["--size", "10x12"], "its size is 10x12, not 12x10"),
        (&["--max-bounces", "3"], "its bounces is 3, not 6"),
        (&["--channels", "rgb"], "its channels is 3, not 1"),
        (&["--split-bounces"], "its splitting of bounces is true, not false"),
        (&["--gather-photons", "0"], "its number of chains through mirrors is 0, not 16"),
    ];
    let other = bench.path("other.krylux");
    for (options, difference) in others {
        let of_options = |name: &&str| !options.contains(name);
        let kept: Vec<&str> =
            bench.options.chunks(2).filter(|pair| of_options(&pair[0])).flatten().copied().collect();
        let shard = ["--shard", "2/4", "-o", &other];
        bench.says(&[&["matrix", &bench.scene], &kept[..], options, &shard].concat());
        let output = bench.join(&[one, &other, three, four], "A.npz");
        assert_error(&output, &["other.krylux", "not of the same matrix as", "1.krylux", difference]);
        std::fs::remove_file(&other).expect("it was written");
    }
    let cornell = Bench::new(&scene_path("cornell"), &["--size", "12x10", "--spp", "4"]);
    let output = bench.join(&[one, &cornell.shard(2, 4), three, four], "A.npz");
    assert_error(&output, &["2.krylux", "1.krylux", "its scene is "]);
    bench.shard_with("other.krylux", 2, 5, &[]);
    let output = bench.join(&[one, &other, three, four], "A.npz");
    assert_error(&output, &["other.krylux", "1.krylux", "one of 5 parts, not of 4"]);
    let output = bench.join(&[one, &bench.path("none.krylux"), three, four], "A.npz");
    assert_error(&output, &["none.krylux"]);
    let output = bench.join(&[one, &scene_path("corner").display().to_string()], "A.npz");
    assert_error(&output, &["scene.glb", "not a shard"]);
    assert!(!Path::new(&bench.path("A.npz")).exists() && !Path::new(&bench.path("cache")).exists());

    let output = bench.join(&[one, two, three, four], "A.npz");
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn a_part_that_is_there_twice_counts_once_if_it_is_the_same() {
    let bench = Bench::small();
    let shards = [bench.shard(1, 2), bench.shard(2, 2)];
    bench.shard_with("again.krylux", 2, 2, &[]);
    let again = bench.path("again.krylux");
    let output = bench.join(&[&again, &shards[0], &shards[1]], "A.npz");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("2.krylux is left out"), "{}", text(&output.stderr));
    bench.whole("whole.npz", &[]);
    assert!(bench.bytes("A.npz") == bench.bytes("whole.npz"));

    // A machine that counts wrong, whose file is sound.
    let mut bytes = bench.bytes("again.krylux");
    let end = bytes.len() - 32;
    bytes[end - 30] ^= 1;
    reseal(&mut bytes);
    std::fs::write(&again, bytes).expect("it is ours");
    let output = bench.join(&[&again, &shards[0], &shards[1]], "A.npz");
    assert_error(&output, &["2.krylux", "part 2 of 2", "again.krylux", "other light paths", "--shard 2/2"]);
}

/// Makes the digest of a file right.
fn reseal(bytes: &mut [u8]) {
    let (content, digest) = bytes.split_at_mut(bytes.len() - 32);
    digest.copy_from_slice(blake3::hash(content).as_bytes());
}

#[test]
fn a_damaged_shard_is_refused_wherever_the_damage_is() {
    let bench = Bench::small();
    let shards = [bench.shard(1, 2), bench.shard(2, 2)];
    let sound = bench.bytes("2.krylux");
    let refused = |bytes: &[u8]| {
        std::fs::write(&shards[1], bytes).expect("it is ours");
        let output = bench.join(&[&shards[0], &shards[1]], "A.npz");
        assert_error(&output, &["2.krylux"])
    };
    for length in [0, 5, 40, sound.len() / 2, sound.len() - 33, sound.len() - 1] {
        let message = refused(&sound[..length]);
        assert!(message.contains("cut short or damaged") && message.contains("trace it again"), "{message}");
    }
    assert!(refused(&sound[..sound.len() - 1]).contains("--shard 2/2"));
    assert!(refused(&[&sound[..], b"x"].concat()).contains("cut short or damaged"));
    // One bit in each stretch of the file: the format, the head, every array, the digest.
    for at in (0..sound.len()).step_by(sound.len() / 40) {
        let mut bytes = sound.clone();
        bytes[at] ^= 4;
        refused(&bytes);
    }
    // A digit of the seed: its file is damaged, not of another seed.
    let seed = sound.windows(10).position(|text| text == br#""seed":"0""#).expect("the head says it");
    let mut bytes = sound.clone();
    bytes[seed + 8] = b'7';
    let message = refused(&bytes);
    assert!(message.contains("cut short or damaged"), "{message}");
}

#[test]
fn only_a_scene_has_shards() {
    let bench = Bench::small();
    let path = bench.path("1.krylux");
    let rig = root().join("assets/rigs/ideal.toml").display().to_string();
    let output = bench.run(&["matrix", &rig, "--shard", "1/2", "-o", &path]);
    assert_error(&output, &["--shard", "only a scene"]);
    for (shard, more) in [("0/2", &["-o", path.as_str()][..]), ("3/2", &["-o", &path]), ("1/2", &[])] {
        let output = bench.run(&[&["matrix", &bench.scene, "--shard", shard], more].concat());
        assert_error(&output, &["--shard"]);
    }
    assert_error(&bench.run(&["matrix"]), &["SOURCE"]);
    assert_error(&bench.run(&["matrix", "join"]), &["SHARDS"]);
}

#[test]
fn shards_larger_than_the_memory_are_not_read() {
    let bench = Bench::small();
    let shards = [bench.shard(1, 2), bench.shard(2, 2)];
    let file = std::fs::OpenOptions::new().write(true).open(&shards[0]).expect("it was written");
    file.set_len(1 << 40).expect("a hole takes no room");
    assert_error(&bench.join(&[&shards[0], &shards[1]], "A.npz"), &["SHARDS", "memory"]);
}
