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
mod client;
pub mod frame;
mod link;
mod readings;
mod seal;
mod server;
mod timing;

pub use address::{Address, BindScope, LinkError, ServerError, is_loopback, resolve};
pub use client::{CONNECT, NetController, NetRig};
pub use frame::{Reading, Refusal};
pub use link::POLL;
pub use readings::Readings;
pub use seal::Key;
pub use server::{RAMP_SAMPLES, Role, Served, Server, Service};
pub use timing::{Counters, Ended, RealTimeClock, ReportLost, Session, Timing};
