//! Live images in the image viewer tev.
//!
//! A background thread sends the images, so that the capture never waits. For each image and channel, the thread keeps only the newest
//! version that is not sent yet. A missing or lost viewer causes one warning.

use std::collections::{BTreeSet, VecDeque};
use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::image::Resolution;

/// The time limit for the viewer to answer or to accept data. After this time, the viewer counts as disconnected.
const PATIENCE: Duration = Duration::from_secs(5);

/// The time limit for sending the remaining images at the end of a run.
const FAREWELL: Duration = Duration::from_secs(1);

/// The maximum number of unsent planes. If there are more, the oldest plane is dropped.
const WAITING: usize = 16;

/// One channel of an image.
#[derive(Clone, Debug)]
pub struct Plane {
    /// The image's name.
    pub name: String,
    /// The image's resolution.
    pub size: Resolution,
    /// Names of all channels of the image.
    pub channels: &'static [&'static str],
    /// Index of this channel.
    pub channel: usize,
    /// One value per pixel, row by row from the top left.
    pub values: Vec<f32>,
}

/// A background connection to the viewer. When it is dropped, the queued images are sent, for at most one second.
pub struct Viewer(Arc<Shared>);

#[derive(Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

#[derive(Default)]
struct Queue {
    waiting: VecDeque<Plane>,
    /// Whether no more planes will be added.
    closed: bool,
    ended: bool,
}

impl Viewer {
    /// Connects to the viewer at `address` (`HOST:PORT`). `warn` is called at most once, when the connection fails.
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
        // If no thread can be started, there is neither a viewer nor a warning.
        if std::thread::Builder::new().name("viewer".into()).spawn(work).is_err() {
            shared.queue().ended = true;
        }
        Self(shared)
    }

    /// Queues a channel of an image for sending, without waiting.
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
    /// A poisoned lock is safe to use, since no code can panic in the middle of a change.
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next plane. Returns `None` when the queue is closed and empty.
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
                // An image with this name may still be open from an earlier run, with another resolution, so it is closed first.
                stream.write_all(&packet::close_image(&plane.name))?;
                stream.write_all(&packet::create_image(&plane.name, plane.size, plane.channels))?;
            }
            let channel = plane.channels.get(plane.channel).copied().unwrap_or("Y");
            stream.write_all(&packet::update_image(&plane.name, plane.size, channel, &plane.values))?;
        }
        stream.flush()
    }
}

/// Connects to the first address of the host that answers.
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

/// TCP packets of the viewer: a little-endian `u32` length of the whole packet, a type, and fields. A zero byte ends a string.
pub mod packet {
    use crate::image::Resolution;

    const CLOSE_IMAGE: u8 = 2;
    const CREATE_IMAGE: u8 = 4;
    /// The third version of `UpdateImage`: several channels, each with an offset and a stride.
    const UPDATE_IMAGE: u8 = 6;

    /// Creates a black image and replaces any image with this name.
    pub fn create_image(name: &str, size: Resolution, channels: &[&str]) -> Vec<u8> {
        let mut packet = Packet::new(CREATE_IMAGE);
        packet.flag(false).text(name).int(size.width).int(size.height).int(channels.len());
        channels.iter().for_each(|channel| {
            packet.text(channel);
        });
        packet.finished()
    }

    /// Sends all pixels of one channel, row by row from the top left.
    pub fn update_image(name: &str, size: Resolution, channel: &str, values: &[f32]) -> Vec<u8> {
        let mut packet = Packet::new(UPDATE_IMAGE);
        packet.flag(false).text(name).int(1).text(channel);
        packet.int(0).int(0).int(size.width).int(size.height);
        // Offset 0 and stride 1: consecutive values.
        packet.long(0).long(1);
        values.iter().for_each(|value| packet.0.extend(value.to_le_bytes()));
        packet.finished()
    }

    /// The packet that closes the image of this name.
    pub fn close_image(name: &str) -> Vec<u8> {
        let mut packet = Packet::new(CLOSE_IMAGE);
        packet.text(name);
        packet.finished()
    }

    struct Packet(Vec<u8>);

    impl Packet {
        fn new(kind: u8) -> Self {
            Self(vec![0, 0, 0, 0, kind])
        }

        fn flag(&mut self, value: bool) -> &mut Self {
            self.0.push(u8::from(value));
            self
        }

        /// Appends a string. Zero bytes inside it would end it early, so they are removed.
        fn text(&mut self, text: &str) -> &mut Self {
            self.0.extend(text.bytes().filter(|&byte| byte != 0));
            self.0.push(0);
            self
        }

        fn int(&mut self, value: usize) -> &mut Self {
            self.0.extend(i32::try_from(value).unwrap_or(i32::MAX).to_le_bytes());
            self
        }

        fn long(&mut self, value: i64) -> &mut Self {
            self.0.extend(value.to_le_bytes());
            self
        }

        fn finished(mut self) -> Vec<u8> {
            let length = u32::try_from(self.0.len()).unwrap_or(u32::MAX);
            self.0[..4].copy_from_slice(&length.to_le_bytes());
            self.0
        }
    }
}
