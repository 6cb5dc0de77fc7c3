//! A cluster of one machine, this one: munged, slurmctld and slurmd with files of their own, which end with the test.

use std::fs::{self, File};
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// The longest that daemons and jobs may take. They take some seconds; a busy machine takes longer.
const PATIENCE: Duration = Duration::from_secs(180);

/// A Slurm cluster with one node of two cores.
pub struct Cluster {
    folder: TempDir,
    /// In the order in which they were started.
    daemons: Vec<Child>,
}

impl Cluster {
    /// Starts the daemons, and waits until a job can run. `Err` says why there is no cluster here.
    pub fn start() -> Result<Self, String> {
        for program in ["munged", "mungekey", "slurmctld", "slurmd", "sbatch", "srun", "sinfo", "scancel"] {
            require_installed(program)?;
        }
        let folder = TempDir::new().map_err(|error| error.to_string())?;
        // Slurm's daemons look into it as somebody else.
        let mode = fs::Permissions::from_mode(0o755);
        fs::set_permissions(folder.path(), mode).map_err(|error| error.to_string())?;
        let mut cluster = Self { folder, daemons: Vec::new() };
        cluster.configure().map_err(|error| format!("the configuration cannot be written: {error}"))?;
        let at = |name: &str| cluster.path(name).display().to_string();
        let [key, socket, conf] = ["munge.key", "munge.socket", "slurm.conf"].map(at);
        let made = Command::new("mungekey").args(["--create", "--keyfile", &key]).output();
        succeeded("mungekey", made)?;
        let [pid, log, seed] = ["munge.pid", "munge.log", "munge.seed"].map(at);
        let munged = [
            "--foreground",
            "--force",
            &format!("--key-file={key}"),
            &format!("--socket={socket}"),
            &format!("--pid-file={pid}"),
            &format!("--log-file={log}"),
            &format!("--seed-file={seed}"),
        ];
        cluster.daemon("munged", &munged)?;
        cluster.wait_for("munged makes its socket", |cluster| cluster.path("munge.socket").exists())?;
        cluster.daemon("slurmctld", &["-D", "-c", "-f", &conf])?;
        cluster.daemon("slurmd", &["-D", "-c", "-N", "node", "-f", &conf])?;
        cluster.wait_for("the node is idle", |cluster| {
            let states = cluster.command("sinfo", &["--noheader", "--format=%T"]).output();
            states.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).trim() == "idle")
        })?;
        Ok(cluster)
    }

    fn configure(&self) -> std::io::Result<()> {
        for folder in ["state", "spool", "work"] {
            fs::create_dir(self.path(folder))?;
        }
        let host = fs::read_to_string("/proc/sys/kernel/hostname")?;
        let host = host.trim().split('.').next().unwrap_or("localhost").to_owned();
        // Free ones, which only somebody very quick could take away.
        let listeners = [TcpListener::bind("127.0.0.1:0")?, TcpListener::bind("127.0.0.1:0")?];
        let [control, node] = listeners.map(|listener| listener.local_addr().map(|address| address.port()));
        let folder = self.folder.path().display();
        // Containers have no cgroups of their own, so that nothing here uses them.
        let text = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={}\nSlurmdPort={}\n\
             SlurmUser=root\nSlurmdUser=root\nAuthType=auth/munge\nAuthInfo=socket={folder}/munge.socket\n\
             CredType=cred/munge\nStateSaveLocation={folder}/state\nSlurmdSpoolDir={folder}/spool\n\
             SlurmctldPidFile={folder}/slurmctld.pid\nSlurmdPidFile={folder}/slurmd.pid\n\
             SlurmctldLogFile={folder}/slurmctld.log\nSlurmdLogFile={folder}/slurmd.log\n\
             ProctrackType=proctrack/pgid\nTaskPlugin=task/none\nJobAcctGatherType=jobacct_gather/none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nMpiDefault=none\nReturnToService=2\n\
             NodeName=node NodeHostname={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=1000 State=UNKNOWN\n\
             PartitionName=all Nodes=node Default=YES State=UP\n",
            control?, node?
        );
        fs::write(self.path("slurm.conf"), text)
    }

    /// A file of the cluster.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The folder that jobs work in.
    pub fn work(&self) -> PathBuf {
        self.path("work")
    }

    /// A program of Slurm, which knows the cluster.
    pub fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(self.work()).env("SLURM_CONF", self.path("slurm.conf"));
        command
    }

    /// Runs a program of Slurm to its end; panics where it takes too long.
    pub fn run(&self, mut command: Command) -> Output {
        let log = |name: &str| File::create(self.path(name)).expect("the folder is writable");
        command.stdin(Stdio::null()).stdout(log("out")).stderr(log("err"));
        let mut child = command.spawn().expect("it is installed");
        let began = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().expect("it is a child of this process") {
                break status;
            }
            if began.elapsed() > PATIENCE {
                let _ = child.kill();
                let _ = child.wait();
                panic!("{command:?} takes too long\n{}", self.logs());
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        let read = |name: &str| fs::read(self.path(name)).unwrap_or_default();
        Output { status, stdout: read("out"), stderr: read("err") }
    }

    fn daemon(&mut self, name: &str, arguments: &[&str]) -> Result<(), String> {
        let log = File::create(self.path(&format!("{name}.out"))).map_err(|error| error.to_string())?;
        let copy = log.try_clone().map_err(|error| error.to_string())?;
        let mut command = Command::new(daemon_path(name));
        command.args(arguments).stdin(Stdio::null()).stdout(log).stderr(copy);
        self.daemons.push(command.spawn().map_err(|error| format!("{name}: {error}"))?);
        Ok(())
    }

    fn wait_for(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) -> Result<(), String> {
        let began = Instant::now();
        while !is_so(self) {
            let has_ended = self.daemons.iter_mut().any(|daemon| !matches!(daemon.try_wait(), Ok(None)));
            if has_ended || began.elapsed() > PATIENCE {
                return Err(format!("it does not come about that {what}\n{}", self.logs()));
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        Ok(())
    }

    /// The last lines that each daemon left.
    pub fn logs(&self) -> String {
        let last = |name: &str| {
            let text = fs::read_to_string(self.path(name)).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            format!("{name}:\n{}\n", lines[lines.len().saturating_sub(8)..].join("\n"))
        };
        ["munged.out", "slurmctld.out", "slurmd.out"].map(last).concat()
    }
}

/// The jobs end, and then the daemons, also where a test fails.
impl Drop for Cluster {
    fn drop(&mut self) {
        if self.daemons.len() == 3 {
            let _ = self.command("scancel", &["--user=root"]).output();
        }
        for mut daemon in self.daemons.drain(..).rev() {
            // They end by a signal that lets them tidy up; one that does not is killed.
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let began = Instant::now();
            while matches!(daemon.try_wait(), Ok(None)) && began.elapsed() < Duration::from_secs(10) {
                std::thread::sleep(Duration::from_millis(50));
            }
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

/// The path of a daemon: such programs are often not on a user's path.
fn daemon_path(name: &str) -> PathBuf {
    let system = ["/usr/sbin", "/usr/local/sbin", "/sbin"].map(|folder| Path::new(folder).join(name));
    system.into_iter().find(|path| path.exists()).unwrap_or_else(|| name.into())
}

fn require_installed(program: &str) -> Result<(), String> {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let is_there = std::env::split_paths(&folders).any(|folder| folder.join(program).exists());
    if is_there || daemon_path(program).exists() {
        return Ok(());
    }
    Err(format!("{program} is not installed (Debian: slurmctld, slurmd, slurm-client, munge)"))
}

fn succeeded(program: &str, output: std::io::Result<Output>) -> Result<(), String> {
    match output {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{program}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(error) => Err(format!("{program}: {error}")),
    }
}
