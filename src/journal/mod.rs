//! A journal: an append-only file of records, each on disk before it is used.
