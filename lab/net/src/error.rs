//! Errors of a connection.

use std::io;
use std::net::SocketAddr;

use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};

use super::frame::VERSION;
use super::refusal::Refusal;

/// Reason why a connection cannot be opened, or cannot continue.
#[derive(Debug, Error)]
pub enum LinkError {
    /// Not an address.
    #[error("{address} is not an address: {message}")]
    Address {
        /// The text.
        address: String,
        /// The fault.
        message: String,
    },
    /// An address beyond this machine, without permission.
    #[error(
        "{address} is not an address of this machine. There is no authentication: everyone who can reach the address can drive \
         the rig. Use --allow-remote only on a network where everyone may do so"
    )]
    Remote {
        /// The address.
        address: SocketAddr,
    },
    /// The server cannot listen on the address.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Error of the system, such as a port that is in use.
        source: io::Error,
    },
    /// There is no answer.
    #[error("no answer from udp://{peer} within {seconds} s: is `vines {role} --listen {peer}` running there?")]
    Unreachable {
        /// The address.
        peer: SocketAddr,
        /// What the client needs: `rig` or `controller`.
        role: &'static str,
        /// Waiting time, s.
        seconds: f64,
    },
    /// The peer has another version of the protocol.
    #[error(
        "udp://{peer} has version {theirs} of the protocol, this program has version {VERSION}: use the same release of both"
    )]
    Version {
        /// The address.
        peer: SocketAddr,
        /// The peer's version.
        theirs: u16,
    },
    /// The peer refuses the session.
    #[error("udp://{peer} refuses: {reason}")]
    Refused {
        /// The address.
        peer: SocketAddr,
        /// Reason.
        reason: Refusal,
    },
    /// The peer is silent.
    #[error("udp://{peer} has been silent for {seconds} s, at t = {time} s of the experiment")]
    Silent {
        /// The address.
        peer: SocketAddr,
        /// Longest silence, s.
        seconds: f64,
        /// Time of the sample whose answer is missing, s.
        time: f64,
    },
    /// The peer has shut down its drive.
    #[error(
        "udp://{peer} has shut down its drive, at t = {time} s of the experiment: it was stopped, or has received no frame from \
         this program for too long"
    )]
    ShutDown {
        /// The address.
        peer: SocketAddr,
        /// Time of the sample, s.
        time: f64,
    },
    /// A step whose length is not the sample time of the session.
    #[error("the step of {step} s is not the sample time of the session with udp://{peer}, {sample_time} s")]
    Step {
        /// The address.
        peer: SocketAddr,
        /// The step, s.
        step: f64,
        /// The sample time of the session, s.
        sample_time: f64,
    },
    /// Error of the network.
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
