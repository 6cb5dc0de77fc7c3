//! A rig of real protocols: a window of a real X server, and a camera on the network that sees what the server shows.
#![cfg(feature = "gige")]

#[path = "../gige_camera/mod.rs"]
mod gige_camera;
#[path = "../x_server/mod.rs"]
mod x_server;

mod bench;
mod files;
mod photos;
mod verbs;
