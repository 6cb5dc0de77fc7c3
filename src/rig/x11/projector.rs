//! The projector as a rig sees it: it asks the helper process, and lives on when that does not.

use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use super::fault;
use super::helper::Helper;
use super::spec::X11Spec;
use super::wire::{self, Reply, Request, ShowTimes};
use crate::error::{Error, Result};
use crate::rig::{Frame, Projector, ProjectorInfo, Shown, Waited, WallClock};

/// How long a helper may take to end by itself.
const FAREWELL: Duration = Duration::from_millis(500);

/// A monitor of an X server.
pub struct X11Projector {
    info: ProjectorInfo,
    spec: X11Spec,
    helper: Helper,
    clock: WallClock,
    process: Option<Process>,
    /// What is on screen, for another helper to show.
    shown: Option<Frame>,
    times: ShowTimes,
    restarts: u64,
}

struct Process {
    child: Child,
    /// None once it is to end.
    requests: Option<ChildStdin>,
    replies: Receiver<Reply>,
    patience: Duration,
}

/// Why there is no answer.
enum Silence {
    /// The helper ended, or does not answer.
    Helper(String),
    /// It answered with an error.
    Said(Error),
}

impl X11Projector {
    /// Opens the window in a process of its own; it shows level 0. Times are told by `clock`.
    ///
    /// # Errors
    /// [`Error::Rig`] when there is no such server or monitor, it is of the wrong size, or does not show what it is told.
    pub fn open(spec: &X11Spec, helper: &Helper, clock: WallClock) -> Result<Self> {
        let mut projector = Self {
            info: spec.info(),
            spec: spec.clone(),
            helper: helper.clone(),
            clock,
            process: None,
            shown: None,
            times: ShowTimes::default(),
            restarts: 0,
        };
        projector.start().map_err(|why| projector.gone(why))?;
        Ok(projector)
    }

    /// Where the time went when the last frame was shown.
    pub fn times(&self) -> ShowTimes {
        self.times
    }

    /// How often the helper process had to be started again.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// The helper's process number, while it lives.
    pub fn helper_id(&self) -> Option<u32> {
        self.process.as_ref().map(|process| process.child.id())
    }

    fn start(&mut self) -> std::result::Result<(), Silence> {
        self.process = Some(Process::start(&self.helper).map_err(Silence::Helper)?);
        match self.ask(&Request::Open(self.spec.clone()), &[])? {
            Reply::Opened { .. } => Ok(()),
            other => Err(Silence::Helper(format!("it answered {other:?}"))),
        }
    }

    fn ask(&mut self, request: &Request, payload: &[u8]) -> std::result::Result<Reply, Silence> {
        let Some(process) = &mut self.process else { return Err(Silence::Helper("it ended".into())) };
        match process.ask(request, payload) {
            Ok(Reply::Fault { fault: what, help }) => Err(Silence::Said(fault(what, help))),
            Ok(reply) => Ok(reply),
            Err(why) => {
                self.process = None;
                Err(Silence::Helper(why))
            }
        }
    }

    fn try_show(&mut self, frame: &Frame) -> std::result::Result<(), Silence> {
        let request = Request::Show { resolution: frame.resolution(), channels: frame.channels() };
        // Levels of 8 bits: the frame was checked.
        let levels: Vec<u8> = frame.levels().iter().map(|&level| level as u8).collect();
        match self.ask(&request, &levels)? {
            Reply::Shown(times) => {
                self.times = times;
                Ok(())
            }
            other => Err(Silence::Helper(format!("it answered {other:?}"))),
        }
    }

    fn gone(&self, why: Silence) -> Error {
        match why {
            Silence::Said(error) => error,
            Silence::Helper(why) => fault(
                format!(
                    "the helper process with its window ({} projector) failed: {why}",
                    self.helper.program.display()
                ),
                "check that the program can be started and that the X server answers; go on with --resume",
            ),
        }
    }
}

impl Projector for X11Projector {
    fn info(&self) -> &ProjectorInfo {
        &self.info
    }

    fn show(&mut self, frame: &Frame) -> Result<Shown> {
        self.info.check(frame)?;
        self.shown = None;
        let first = self.try_show(frame);
        if let Err(Silence::Helper(_)) = first {
            // It crashed or hangs: another one, once.
            self.restarts += 1;
            self.start().and_then(|()| self.try_show(frame)).map_err(|why| self.gone(why))?;
        } else {
            first.map_err(|why| self.gone(why))?;
        }
        self.shown = Some(frame.clone());
        Ok(Shown { at: self.clock.seconds() })
    }

    fn waited(&self) -> Waited {
        Waited { refresh: self.times.present, settle: self.times.settle }
    }

    fn confirm(&mut self) -> Result<()> {
        if self.shown.is_none() {
            return Ok(());
        }
        match self.ask(&Request::Confirm, &[]) {
            Ok(_) => Ok(()),
            Err(why) => Err(self.gone(why)),
        }
    }
}

impl Process {
    fn start(helper: &Helper) -> std::result::Result<Self, String> {
        let mut command = Command::new(&helper.program);
        command.arg("projector").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::inherit());
        // A terminal's interrupt is for the run, which ends the helper when it is done.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|why| why.to_string())?;
        let requests = child.stdin.take();
        let Some(mut answers) = child.stdout.take() else { return Err("it has no standard output".into()) };
        let (sender, replies) = channel();
        std::thread::spawn(move || {
            // An end or an error both end the channel, which is how it is told.
            while let Ok(Some((reply, _))) = wire::receive(&mut answers) {
                if sender.send(reply).is_err() {
                    break;
                }
            }
        });
        Ok(Self { child, requests, replies, patience: helper.patience })
    }

    fn ask(&mut self, request: &Request, payload: &[u8]) -> std::result::Result<Reply, String> {
        let Some(requests) = &mut self.requests else { return Err("it was told to end".into()) };
        let sent = wire::send(requests, request, payload);
        match self.replies.recv_timeout(self.patience) {
            Ok(reply) => Ok(reply),
            Err(RecvTimeoutError::Timeout) => Err(format!("no answer for {:?}", self.patience)),
            Err(RecvTimeoutError::Disconnected) => {
                let ended = self.child.wait().map(|status| status.to_string());
                let why = ended.unwrap_or_else(|why| why.to_string());
                Err(sent
                    .err()
                    .map_or_else(|| format!("it ended ({why})"), |pipe| format!("it ended ({why}; {pipe})")))
            }
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        drop(self.requests.take());
        let began = Instant::now();
        while began.elapsed() < FAREWELL {
            if matches!(self.child.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        // It hangs, and its window must not stay on the monitor.
        if self.child.kill().is_ok() {
            let _ = self.child.wait();
        }
    }
}
