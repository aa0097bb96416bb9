//! Why a link cannot be made, or cannot go on.

use std::io;
use std::net::SocketAddr;

use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};

use super::frame::VERSION;
use super::refusal::Refusal;

/// Why a link cannot be made, or cannot go on.
#[derive(Debug, Error)]
pub enum LinkError {
    /// Not an address.
    #[error("{address} is no address: {message}")]
    Address {
        /// What was given.
        address: String,
        /// What is wrong with it.
        message: String,
    },
    /// An address beyond this machine, without permission.
    #[error(
        "{address} is not of this machine, and whoever reaches it can drive the rig: there is no authentication. \
         Give --allow-remote if that is wanted, on a network where everybody may"
    )]
    Remote {
        /// The address.
        address: SocketAddr,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system said, such as that the port is in use.
        source: io::Error,
    },
    /// Nobody answers.
    #[error(
        "no answer from udp://{peer} within {seconds} s: is `vines {role} --listen {peer}` running there?"
    )]
    Unreachable {
        /// The address.
        peer: SocketAddr,
        /// What was asked for: `rig` or `controller`.
        role: &'static str,
        /// How long it was waited for, s.
        seconds: f64,
    },
    /// The peer speaks another version of the protocol.
    #[error(
        "udp://{peer} speaks version {theirs} of the protocol, this program version {VERSION}: use the same release of both"
    )]
    Version {
        /// The address.
        peer: SocketAddr,
        /// The peer's version.
        theirs: u16,
    },
    /// The peer does not want this session.
    #[error("udp://{peer} refuses: {reason}")]
    Refused {
        /// The address.
        peer: SocketAddr,
        /// Why.
        reason: Refusal,
    },
    /// The peer is gone.
    #[error("udp://{peer} has been silent for {seconds} s, at t = {time} s of the experiment")]
    Silent {
        /// The address.
        peer: SocketAddr,
        /// Longest silence allowed, s.
        seconds: f64,
        /// Time of the sample that was waited for, s.
        time: f64,
    },
    /// The peer has taken its drive away.
    #[error(
        "udp://{peer} has shut down its drive, at t = {time} s of the experiment: it was stopped, or had heard nothing from \
         here for too long"
    )]
    ShutDown {
        /// The address.
        peer: SocketAddr,
        /// Time of the sample, s.
        time: f64,
    },
    /// A step of another length than agreed on.
    #[error("a step of {step} s, where {sample_time} s were agreed on with udp://{peer}")]
    Step {
        /// The address.
        peer: SocketAddr,
        /// The step wanted, s.
        step: f64,
        /// The sample time of the session, s.
        sample_time: f64,
    },
    /// The system's network failed.
    #[error("the network: {0}")]
    System(#[from] io::Error),
}

impl From<LinkError> for RigError {
    fn from(error: LinkError) -> Self {
        Self::Failed(error.into())
    }
}

impl From<LinkError> for ControllerError {
    fn from(error: LinkError) -> Self {
        Self::Failed(error.into())
    }
}
