//! Images in the viewer tev, while they come.
//!
//! A thread of its own talks to the viewer, so that whoever takes photos never waits for it: of what it has not sent yet, only the
//! newest of each image and channel is kept. A viewer that is not there, or goes away, is a warning, once.

pub mod packet;

use std::collections::{BTreeSet, VecDeque};
use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::image::Resolution;

/// How long a viewer may take to answer, or to accept what is sent, before it counts as gone.
const PATIENCE: Duration = Duration::from_secs(5);

/// How long the end of a run waits for the last image to be sent.
const FAREWELL: Duration = Duration::from_secs(1);

/// Images and channels that may wait; with more, the oldest is left out.
const WAITING: usize = 16;

/// A channel of an image.
#[derive(Clone, Debug)]
pub struct Plane {
    /// The image's name.
    pub name: String,
    /// Its pixels.
    pub size: Resolution,
    /// The names of all its channels.
    pub channels: &'static [&'static str],
    /// Which of them this is.
    pub channel: usize,
    /// As many values as pixels, row by row from the top left.
    pub values: Vec<f32>,
}

/// A connection to the viewer, made in the background. Dropped, it sends what still waits, for a second at most.
pub struct Viewer(Arc<Shared>);

#[derive(Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

#[derive(Default)]
struct Queue {
    waiting: VecDeque<Plane>,
    /// Nothing more will come.
    closed: bool,
    /// Nobody sends any more.
    ended: bool,
}

impl Viewer {
    /// Talks to the viewer at `address`, `HOST:PORT`. `warn` is told, once, that it is not there or has gone.
    pub fn new(address: &str, warn: impl FnOnce(&io::Error) + Send + 'static) -> Self {
        let shared = Arc::new(Shared::default());
        let (address, own) = (address.to_owned(), Arc::clone(&shared));
        let work = move || {
            if let Err(error) = connect(&address).and_then(|stream| own.send_all(stream)) {
                warn(&error);
            }
            let mut queue = own.queue();
            queue.ended = true;
            queue.waiting.clear();
            own.changed.notify_all();
        };
        // Without a thread there is no viewer; what it would have said is lost with it.
        if std::thread::Builder::new().name("viewer".into()).spawn(work).is_err() {
            shared.queue().ended = true;
        }
        Self(shared)
    }

    /// Shows a channel of an image as soon as the viewer is ready for it. Never waits.
    pub fn show(&self, plane: Plane) {
        let mut queue = self.0.queue();
        if queue.ended {
            return;
        }
        let same = |other: &Plane| other.name == plane.name && other.channel == plane.channel;
        queue.waiting.retain(|other| !same(other));
        if queue.waiting.len() == WAITING {
            queue.waiting.pop_front();
        }
        queue.waiting.push_back(plane);
        self.0.changed.notify_all();
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let end = Instant::now() + FAREWELL;
        let mut queue = self.0.queue();
        queue.closed = true;
        self.0.changed.notify_all();
        while !queue.ended {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            queue = self.0.changed.wait_timeout(queue, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Shared {
    /// Nothing that holds the lock can panic half-way through a change.
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next plane; none when nothing more will come.
    fn next(&self) -> Option<Plane> {
        let mut queue = self.queue();
        loop {
            if let Some(plane) = queue.waiting.pop_front() {
                return Some(plane);
            }
            if queue.closed {
                return None;
            }
            queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn send_all(&self, mut stream: TcpStream) -> io::Result<()> {
        let mut known = BTreeSet::new();
        while let Some(plane) = self.next() {
            if known.insert(plane.name.clone()) {
                // One that an earlier run left has other pixels, perhaps.
                stream.write_all(&packet::close_image(&plane.name))?;
                stream.write_all(&packet::create_image(&plane.name, plane.size, plane.channels))?;
            }
            let channel = plane.channels.get(plane.channel).copied().unwrap_or("Y");
            stream.write_all(&packet::update_image(&plane.name, plane.size, channel, &plane.values))?;
        }
        stream.flush()
    }
}

/// The first of the host's addresses that answers.
fn connect(address: &str) -> io::Result<TcpStream> {
    let mut failure = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(PATIENCE))?;
                return Ok(stream);
            }
            Err(error) => failure = error,
        }
    }
    Err(failure)
}
