//! The network door: a rig or a controller at a UDP address, sample by sample.
//!
//! A *server* offers a rig ([`RigServer`]) or a controller ([`ControllerServer`]); a *client* ([`NetRig`], [`NetController`]) stands on
//! its side of the bench like any other. What goes over the wire is in `docs/network-protocol.md`.
//!
//! What is lost, late, repeated, reordered, foreign or malformed is counted and survived: the last good value is held, and
//! after a stated silence the drive is taken away for the rest of the session. Nothing here proves who a peer is: see
//! [`Reach`].

#![forbid(unsafe_code)]

mod address;
mod caller;
mod controller_client;
mod controller_server;
mod counters;
mod error;
pub mod frame;
mod host;
mod order;
mod pace;
mod payload;
mod port;
mod refusal;
mod report;
mod rig_client;
mod rig_server;
mod watch;

pub use address::{Reach, resolve};
pub use controller_client::NetController;
pub use controller_server::{ControllerServer, ControllerService};
pub use counters::Counters;
pub use error::LinkError;
pub use pace::{CLASSES, Punctuality};
pub use refusal::Refusal;
pub use report::{Ended, Session};
pub use rig_client::NetRig;
pub use rig_server::{RigServer, RigService};
pub use watch::RAMP_SAMPLES;
