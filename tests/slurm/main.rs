//! Jobs under Slurm: an array of shards by the script of `docs/clusters.md`, and processes that work together by MPI.
//!
//! If Slurm is not installed or its daemons cannot start, the tests say why and do nothing; with `KRYLUX_REQUIRE_SLURM=1` they fail instead.
//! Processes that work together are tested with `--features mpi`, or with the program that `KRYLUX_MPI_PROGRAM` names.
#![cfg(target_os = "linux")]
#![allow(clippy::panic, reason = "a failed test panics")]

mod cluster;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use cluster::Cluster;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn scene() -> String {
    root().join("assets/scenes/corner/scene.glb").display().to_string()
}

/// The cluster, or `None` where there is none; the reason is said by the name of the test.
fn cluster(test: &str) -> Option<Cluster> {
    match Cluster::start() {
        Ok(cluster) => Some(cluster),
        Err(why) => {
            let is_required = std::env::var("KRYLUX_REQUIRE_SLURM").is_ok_and(|value| value == "1");
            assert!(!is_required, "{test}: {why}");
            println!("not run: {test}: {why}");
            None
        }
    }
}

/// The block of a page of `docs/` that is the content of the file `name`.
fn printed(page: &str, name: &str) -> String {
    let text = std::fs::read_to_string(root().join("docs").join(page)).expect("the page is there");
    let mark = format!("<!-- file: {name} -->\n");
    let block = text.split(&mark).nth(1).and_then(|rest| rest.split("```").nth(1));
    let block = block.unwrap_or_else(|| panic!("{page} has no file {name}"));
    block.split_once('\n').map(|(_, lines)| lines.to_owned()).expect("a block has lines")
}

/// The folder of the program, before all others.
fn path() -> String {
    let folder = Path::new(env!("CARGO_BIN_EXE_krylux")).parent().expect("a file is in a folder");
    format!("{}:{}", folder.display(), std::env::var("PATH").unwrap_or_default())
}

#[track_caller]
fn succeeded(output: &Output, cluster: &Cluster) -> String {
    let said =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
    let jobs = std::fs::read_dir(cluster.work()).into_iter().flatten().flatten().map(|entry| entry.path());
    let logs: Vec<PathBuf> = jobs.filter(|path| path.extension().is_some_and(|of| of == "log")).collect();
    let logs = logs.iter().map(|log| std::fs::read_to_string(log).unwrap_or_default());
    let logs = logs.collect::<String>();
    assert!(output.status.success(), "{said}\njobs:\n{logs}\n{}", cluster.logs());
    said
}

const OPTIONS: [&str; 4] = ["--size", "24x20", "--spp", "8"];

/// One test, since both kinds of jobs need the same daemons.
#[test]
fn slurm_runs_an_array_of_shards_and_processes_that_work_together() {
    let Some(cluster) = cluster("slurm_runs_an_array_of_shards_and_processes_that_work_together") else {
        return;
    };
    let work = cluster.work();
    for name in ["shards.sh", "join.sh"] {
        std::fs::write(work.join(name), printed("clusters.md", name)).expect("the folder is writable");
    }
    let sbatch = |more: &[&str]| {
        let mut command =
            cluster.command("sbatch", &[&["--wait", "--cpus-per-task=1", "--mem=0"], more].concat());
        command.env("PATH", path()).env("KRYLUX_CACHE", work.join("cache"));
        command.env("SCENE", scene()).env("OPTIONS", OPTIONS.join(" ")).env("PARTS", "4");
        succeeded(&cluster.run(command), &cluster)
    };
    sbatch(&["--array=1-4", "shards.sh"]);
    // After a lost job only the missing shard is traced.
    std::fs::remove_file(work.join("shard-3.krylux")).expect("the array wrote it");
    sbatch(&["--array=1-4", "shards.sh"]);
    let said =
        |part: usize| std::fs::read_to_string(work.join(format!("shard-{part}.log"))).unwrap_or_default();
    assert!(said(2).contains("nothing is traced") && !said(3).contains("nothing is traced"), "{}", said(2));
    sbatch(&["join.sh"]);

    let whole = work.join("whole.npz");
    let mut alone = Command::new(env!("CARGO_BIN_EXE_krylux"));
    alone.args(["matrix", &scene(), "--no-cache", "-o"]).arg(&whole).args(OPTIONS);
    assert!(alone.status().expect("it is built with the tests").success());
    let [joined, whole] =
        ["matrix.npz", "whole.npz"].map(|name| std::fs::read(work.join(name)).unwrap_or_default());
    assert!(joined.len() > 1000 && joined == whole, "the array's matrix has the bits of one run");

    processes_work_together(&cluster);
}

/// `srun` starts two processes of one segmentation, with light enough that its own check lets it end with 0.
fn processes_work_together(cluster: &Cluster) {
    let own = cfg!(feature = "mpi").then(|| env!("CARGO_BIN_EXE_krylux").into());
    let Some(program) = std::env::var_os("KRYLUX_MPI_PROGRAM").or(own) else {
        println!("not run: processes under srun: it takes --features mpi, or KRYLUX_MPI_PROGRAM");
        return;
    };
    let kinds = cluster.run(cluster.command("srun", &["--mpi=list"]));
    let kinds = String::from_utf8_lossy(&[kinds.stdout, kinds.stderr].concat()).into_owned();
    if !kinds.contains("pmix") {
        println!("not run: processes under srun: this Slurm has no pmix, by which Open MPI starts: {kinds}");
        return;
    }
    let segment = |mut command: Command, folder: &str| {
        let scene = scene();
        command.args(["segment", &scene, "--no-cache", "--groups", "2", "--photos", "8", "-o", folder]);
        command.args(["--size", "24x20", "--spp", "256"]);
        succeeded(&cluster.run(command), cluster);
        ["labels-2.npy", "eigenvectors.npy"].map(|name| {
            std::fs::read(cluster.work().join(folder).join(name)).expect("a segmentation leaves it")
        })
    };
    let srun = |arguments: &[&str]| {
        let mut command = cluster.command("srun", &["--mpi=pmix", "--ntasks=2", "--mem=0"]);
        command.arg(&program).args(arguments);
        command
    };
    let info = cluster.run(srun(&["info", "--json"]));
    let info: serde_json::Value = serde_json::from_slice(&info.stdout).unwrap_or_default();
    assert_eq!(info["processes"].as_array().map(Vec::len), Some(2), "one of them speaks: {info}");
    let together = srun(&[]);
    let mut alone = Command::new(env!("CARGO_BIN_EXE_krylux"));
    alone.current_dir(cluster.work());
    assert!(segment(together, "together") == segment(alone, "alone"), "two processes find the bits of one");
}
