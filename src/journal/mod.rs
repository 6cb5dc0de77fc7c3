//! Journals: append-only files of photos.
//!
//! Photos are expensive, so a run appends each photo to its journal before it uses it. A run that was killed
//! at any moment can be resumed from its journal without taking a photo twice. A finished run can be replayed
//! from its journal, with the same or another analysis, without the rig. A journal stores keys and bytes;
//! their meaning is defined by the writers ([`crate::measure::JournaledFrames`] for a rig,
//! [`crate::transport::JournaledOperator`] for a scene).
//!
//! # File format
//!
//! A journal is a folder with the file `photos.journal` and a lock file. The writer holds the lock. The
//! journal file consists of two copies of the header and of the records:
//!
//! ```text
//! header   magic 8 · version u32 · length u32 · BLAKE3 of these and the identity 32 · identity, JSON
//! record   marker 8 · kind u32 · metadata's length u32 · payload's length u64 · key 32 · BLAKE3 of the payload 32
//!          · BLAKE3 of the identity, of all before, and of the metadata 32 · metadata, JSON · payload
//! ```
//!
//! The numbers are lengths in bytes. Integers are little-endian. The [`Identity`] names everything that all
//! photos depend on, and a journal with another identity is refused. The part of a record before its metadata
//! is the head. Its checksum tells whether the lengths in it are valid. If they are not, reading continues at
//! the next marker with a valid head. Heads are checked when a journal is opened, and payloads when they are
//! read. Opening therefore does not read the photos.
//!
//! # Faults
//!
//! | fault | result |
//! |---|---|
//! | the writer is killed | the incomplete record at the end is cut off; [`Journal::torn`] reports it |
//! | bits are flipped | [`Journal::damages`] names the record, which then counts as not written |
//! | the disk is full, read-only or unplugged | [`Error::Journal`](crate::Error::Journal); all complete records stay |
//! | there is a second writer | an error that names the process of the first |

mod file;
mod header;
mod identity;
mod key;
mod lock;
mod open;
mod record;
mod scan;

pub use file::{Journal, Stored};
pub use identity::Identity;
pub use key::Key;
pub use record::{Entry, Kind};
pub use scan::{Damage, Torn};
