//! The program as a user meets it.

mod bench;
mod bytes;
mod captures;
mod certificates;
mod files;
mod folders;
mod index;
mod info;
mod kept;
mod light;
mod limits;
mod links;
mod live;
#[cfg(target_os = "linux")]
mod lost_device;
mod machines;
mod manners;
mod manual;
mod operator;
mod overwrite;
mod piles;
mod products;
mod reproduce;
mod rig;
mod shards;
mod sources;
mod streams;
mod verbs;
