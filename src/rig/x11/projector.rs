//! The projector of a rig. The projector sends requests to the helper process, and starts another process when the helper fails. Each
//! message in either direction consists of two lengths as little-endian 32-bit numbers, a JSON header, and raw bytes.

use std::io;
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::helper::Helper;
use super::{X11Spec, fault};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::gphoto2::body::wait;
use crate::rig::{Frame, Projector, ProjectorInfo, Shown, Waited, WallClock};

/// The longest time that a helper may take to end before it is killed.
const FAREWELL: Duration = Duration::from_millis(500);

/// A projector that is a monitor of an X server.
pub struct X11Projector {
    info: ProjectorInfo,
    spec: X11Spec,
    helper: Helper,
    clock: WallClock,
    process: Option<Process>,
    /// Whether a frame is known to be on screen.
    is_shown: bool,
    times: ShowTimes,
    restarts: u64,
}

struct Process {
    child: Child,
    replies: Receiver<Reply>,
    patience: Duration,
}

enum Failure {
    /// The helper process ended or does not answer. The text gives the details.
    Helper(String),
    Projector(Error),
}

impl X11Projector {
    /// Opens the window, which shows level 0, in a process of `helper`. The times of confirmations are read from `clock`.
    ///
    /// # Errors
    /// [`Error::Rig`] when the helper cannot be started, there is no such server or monitor, or the monitor has the wrong size or does not
    /// show the requested levels.
    pub fn open(spec: &X11Spec, helper: &Helper, clock: WallClock) -> Result<Self> {
        let mut projector = Self {
            info: spec.info(),
            spec: spec.clone(),
            helper: helper.clone(),
            clock,
            process: None,
            is_shown: false,
            times: ShowTimes::default(),
            restarts: 0,
        };
        projector.start().map_err(|why| projector.gone(why))?;
        Ok(projector)
    }

    /// The time that each step of showing the last frame took.
    pub fn times(&self) -> ShowTimes {
        self.times
    }

    /// The number of times that the helper process was started again.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// The process number of the helper while it runs.
    pub fn helper_id(&self) -> Option<u32> {
        self.process.as_ref().map(|process| process.child.id())
    }

    fn start(&mut self) -> std::result::Result<(), Failure> {
        self.process = Some(Process::start(&self.helper).map_err(Failure::Helper)?);
        self.ask(&Request::Open(self.spec.clone()), &[]).map(|_| ())
    }

    fn ask(&mut self, request: &Request, payload: &[u8]) -> std::result::Result<ShowTimes, Failure> {
        let Some(process) = &mut self.process else { return Err(Failure::Helper("it ended".into())) };
        match process.ask(request, payload) {
            Ok(reply) => reply.map_err(|[what, help]| Failure::Projector(fault(what, help))),
            Err(why) => {
                self.process = None;
                Err(Failure::Helper(why))
            }
        }
    }

    fn try_show(&mut self, frame: &Frame) -> std::result::Result<(), Failure> {
        let request = Request::Show { resolution: frame.resolution(), channels: frame.channels() };
        // The frame has been checked, so its levels have 8 bits.
        let levels: Vec<u8> = frame.levels().iter().map(|&level| level as u8).collect();
        self.times = self.ask(&request, &levels)?;
        Ok(())
    }

    fn gone(&self, why: Failure) -> Error {
        match why {
            Failure::Projector(error) => error,
            Failure::Helper(why) => fault(
                format!(
                    "the helper process with its window ({} projector) failed: {why}",
                    self.helper.program.display()
                ),
                "check that the program can be started and that the X server answers",
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
        self.is_shown = false;
        let mut tried = self.try_show(frame);
        if let Err(Failure::Helper(_)) = tried {
            // The helper crashed or hangs. Another helper is started once.
            self.restarts += 1;
            tried = self.start().and_then(|()| self.try_show(frame));
        }
        tried.map_err(|why| self.gone(why))?;
        self.is_shown = true;
        Ok(Shown { at: self.clock.seconds() })
    }

    fn waited(&self) -> Waited {
        Waited { refresh: self.times.present, settle: self.times.settle }
    }

    fn confirm(&mut self) -> Result<()> {
        if !self.is_shown {
            return Ok(());
        }
        self.ask(&Request::Confirm, &[]).map(|_| ()).map_err(|why| self.gone(why))
    }
}

impl Process {
    fn start(helper: &Helper) -> std::result::Result<Self, String> {
        let mut command = Command::new(&helper.program);
        command.arg("projector").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::inherit());
        // An interrupt in the terminal does not reach a separate process group. It reaches only the run, which ends the helper.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|why| why.to_string())?;
        let Some(mut answers) = child.stdout.take() else { return Err("it has no standard output".into()) };
        let (sender, replies) = channel();
        let reader = std::thread::Builder::new().spawn(move || {
            // When the pipe ends or fails, the channel closes, and `ask` notices this.
            while let Ok(Some((reply, _))) = receive(&mut answers) {
                if sender.send(reply).is_err() {
                    break;
                }
            }
        });
        let process = Self { child, replies, patience: helper.patience };
        match reader {
            Ok(_) => Ok(process),
            Err(why) => {
                Err(format!("no thread can be started ({why}): raise the limit of processes (`ulimit -u`)"))
            }
        }
    }

    fn ask(&mut self, request: &Request, payload: &[u8]) -> std::result::Result<Reply, String> {
        let Some(requests) = &mut self.child.stdin else { return Err("it was told to end".into()) };
        let sent = send(requests, request, payload);
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
        drop(self.child.stdin.take());
        // A helper that hangs is killed, because its window must not stay on the monitor.
        let _ = wait(&mut self.child, FAREWELL);
    }
}

/// The length of the longest accepted header or payload: a colour frame of 16384² pixels.
const LONGEST: usize = 3 << 28;

#[derive(Debug, Serialize, Deserialize)]
pub(crate) enum Request {
    Open(X11Spec),
    /// Show the levels in the payload, which has one byte for each level.
    Show {
        resolution: Resolution,
        channels: usize,
    },
    Confirm,
}

/// The times of a frame that was shown, which are 0 for other requests. An error is a fault and its remedy.
pub(crate) type Reply = std::result::Result<ShowTimes, [String; 2]>;

/// Seconds that each step of showing a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShowTimes {
    /// Time to convert levels to pixels and send them to the server.
    pub draw: f64,
    /// Time to wait for the server's confirmation.
    pub present: f64,
    /// Time to wait for further refreshes after the frame has been read back.
    pub settle: f64,
    /// Time to read the frame back, which happens while refreshes pass.
    pub verify: f64,
}

pub(crate) fn send(to: &mut impl Write, header: &impl Serialize, payload: &[u8]) -> io::Result<()> {
    let header = serde_json::to_vec(header)?;
    // The message is written in one piece, so that the reader is woken once.
    let mut message = Vec::with_capacity(8 + header.len() + payload.len());
    message.extend((header.len() as u32).to_le_bytes());
    message.extend((payload.len() as u32).to_le_bytes());
    message.extend(header);
    message.extend(payload);
    to.write_all(&message)?;
    to.flush()
}

pub(crate) fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<Option<(T, Vec<u8>)>> {
    let mut lengths = [0_u8; 8];
    match from.read_exact(&mut lengths) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let (lengths, _) = lengths.as_chunks::<4>();
    let [header, payload] = [0, 1].map(|at: usize| u32::from_le_bytes(lengths[at]) as usize);
    if header > LONGEST || payload > LONGEST {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "the message is too long"));
    }
    let mut read = |length: usize| {
        let mut bytes = vec![0; length];
        from.read_exact(&mut bytes).map(|()| bytes)
    };
    let header = serde_json::from_slice(&read(header)?)?;
    Ok(Some((header, read(payload)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_as_they_were_sent_and_a_torn_one_is_an_error() {
        let mut bytes = Vec::new();
        send(&mut bytes, &Request::Confirm, &[]).expect("memory takes all");
        let header = Request::Show { resolution: Resolution::new(2, 1), channels: 1 };
        send(&mut bytes, &header, &[7, 9]).expect("memory takes all");
        let mut from = bytes.as_slice();
        let first: Option<(Request, Vec<u8>)> = receive(&mut from).expect("it is whole");
        assert!(matches!(first, Some((Request::Confirm, payload)) if payload.is_empty()));
        let second: Option<(Request, Vec<u8>)> = receive(&mut from).expect("it is whole");
        assert!(matches!(second, Some((Request::Show { channels: 1, .. }, payload)) if payload == [7, 9]));
        assert!(receive::<Request>(&mut from).expect("the end is no error").is_none());
        assert!(receive::<Request>(&mut &bytes[..bytes.len() - 1][..]).is_ok());
        let torn = &mut &bytes[..12];
        assert!(receive::<Request>(torn).is_err());
        assert!(receive::<Request>(&mut &[255; 16][..]).is_err(), "no length is believed beyond reason");
    }
}
