//! A journal: an append-only file of photos, each written down before it is used.
//!
//! What a run photographs is dear, so it is written down before anything is made of it. A run that is killed at any moment goes
//! on from its journal without taking one photo twice; a finished one is repeated from it, or asked something else, with
//! nothing attached. The journal knows keys and bytes only; what they mean is for those to say who write them
//! ([`crate::measure::Journaled`] for a rig, [`crate::transport::JournaledOperator`] for a scene).
//!
//! # On disk
//!
//! A folder with the file `photos.journal` and a lock that one writer holds. The file is a header, twice, and then records:
//!
//! ```text
//! header   magic 8 · version u32 · length u32 · BLAKE3 of these and the identity 32 · identity, JSON
//! record   marker 8 · kind u32 · metadata's length u32 · payload's length u64 · key 32 · BLAKE3 of the payload 32
//!          · BLAKE3 of the identity, of all before, and of the metadata 32 · metadata, JSON · payload
//! ```
//!
//! Integers are little-endian. The [`Identity`] is what all photos depend on; a journal of another one is never mixed in.
//! Of the record, the head says by its checksum whether its lengths can be trusted; if not, the next marker whose head can be
//! trusted is where it goes on. Heads are checked when a journal is opened, payloads when they are read, so that opening takes
//! no time and no memory for photos.
//!
//! # What can go wrong
//!
//! | fault | what becomes of it |
//! |---|---|
//! | killed while writing | the torn end is cut off, and [`Journal::torn`] says so |
//! | flipped bits | [`Journal::damages`] names the record; it is as if it had never been written |
//! | disk full, read-only, unplugged | [`Error::Journal`](crate::Error::Journal); what is there stays, back to the last whole record |
//! | a second writer | refused by name |

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
