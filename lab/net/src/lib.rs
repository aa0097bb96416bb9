//! Rigs and controllers at network addresses, sample by sample.
//!
//! A [`Server`] offers a rig or a controller. A client ([`NetRig`], [`NetController`]) is a rig or a controller of the bench like
//! any other. A controller, or a rig in lock-step, answers frame by frame over TCP. A rig in real time exchanges datagrams over
//! UDP: frames that are lost, late, foreign or malformed are counted, and the last valid value is held. The protocol is in
//! `docs/network-protocol.md`.
//!
//! After a configured silence the drive is shut down for the rest of the session. With a shared [`Key`], every frame is
//! authenticated; without one, see [`BindScope`].

#![forbid(unsafe_code)]

mod address;
mod bridge;
mod client;
mod controller_client;
mod error;
pub mod frame;
mod handshake;
mod link;
mod payload;
mod ramp;
mod real_time_clock;
mod report;
mod resolve;
mod rig_client;
mod run;
mod seal;
mod server;

pub use address::{Address, BindScope, is_loopback};
pub use bridge::Bridge;
pub use controller_client::NetController;
pub use error::{LinkError, ServerError};
pub use handshake::{Refusal, Role, Service};
pub use ramp::RAMP_SAMPLES;
pub use real_time_clock::{Punctuality, RealTimeClock};
pub use report::{Counters, Ended, ReportLost, Session, Timing};
pub use resolve::resolve;
pub use rig_client::NetRig;
pub use run::Served;
pub use seal::Key;
pub use server::Server;
