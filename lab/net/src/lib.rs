//! Rigs and controllers at UDP addresses, sample by sample.
//!
//! A *server* offers a rig ([`RigServer`]) or a controller ([`ControllerServer`]). A *client* ([`NetRig`], [`NetController`]) is a rig
//! or a controller of the bench like any other. The protocol is in `docs/network-protocol.md`.
//!
//! Frames that are lost, late, repeated, out of order, foreign or malformed are counted; the last valid value is held. After
//! a configured silence the drive is shut down for the rest of the session. There is no authentication: see [`BindScope`].

#![forbid(unsafe_code)]

mod address;
mod client;
mod controller_client;
mod controller_server;
mod counters;
mod error;
pub mod frame;
mod frame_socket;
mod payload;
mod real_time_clock;
mod refusal;
mod report;
mod rig_client;
mod rig_server;
mod sequence_window;
mod server_session;
mod watchdog;

pub use address::{BindScope, resolve};
pub use controller_client::NetController;
pub use controller_server::{ControllerServer, ControllerService};
pub use counters::Counters;
pub use error::LinkError;
pub use real_time_clock::{CLASSES, Punctuality};
pub use refusal::Refusal;
pub use report::{Ended, Session};
pub use rig_client::NetRig;
pub use rig_server::{RigServer, RigService};
pub use watchdog::RAMP_SAMPLES;
