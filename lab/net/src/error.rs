//! Errors of a connection.

use std::io;
use std::net::SocketAddr;

use thiserror::Error;
use vines_testbench::rig::{ControllerError, RigError};

use super::address::Address;
use super::frame::VERSION;
use super::handshake::Refusal;

/// Reason why a connection cannot be opened, or cannot continue. Times are in s; the messages explain the fields.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum LinkError {
    /// Not an address.
    #[error("{address} is not an address: {message}")]
    Address { address: String, message: String },
    /// An address beyond this machine, without permission.
    #[error(
        "{address} is not a loopback address. Use --key on both sides; without it, everyone who can reach the address can drive the \
         rig, so use --allow-remote only on a network where everyone may do so"
    )]
    Remote { address: SocketAddr },
    /// The server cannot listen on the address.
    #[error("cannot listen on {address}: {source}")]
    Listen { address: Address, source: io::Error },
    /// There is no answer.
    #[error("no answer from {peer} within {seconds} s: is `{command}` running there, with the same --key or none?")]
    Unreachable {
        peer: Address,
        command: String,
        seconds: f64,
    },
    /// The peer has another version of the protocol.
    #[error(
        "{peer} has version {theirs} of the protocol, this program has version {VERSION}: use the same release of both"
    )]
    Version { peer: Address, theirs: u16 },
    /// The peer refuses the session.
    #[error("{peer} refuses: {reason}")]
    Refused { peer: Address, reason: Refusal },
    /// The peer has other sensors.
    #[error(
        "{peer} measures {theirs}, the [resonance] section of the scene needs {ours}: use the same scene for both, or set resonance.sensor \
         and resonance.reference to what the rig measures"
    )]
    Sensors {
        peer: Address,
        theirs: String,
        ours: String,
    },
    /// The peer is silent.
    #[error("{peer} has been silent for {seconds} s, at t = {time} s of the experiment")]
    Silent { peer: Address, seconds: f64, time: f64 },
    /// The peer has shut down its drive.
    #[error(
        "{peer} has shut down its drive, at t = {time} s of the experiment: it was stopped, or has received no frame from \
         this program for too long"
    )]
    ShutDown { peer: Address, time: f64 },
    /// The peer sent something that is not an answer.
    #[error(
        "{peer} sent a frame that is damaged, has a value that is not allowed, or is not the answer, at t = {time} s of the experiment"
    )]
    Invalid { peer: Address, time: f64 },
    /// A step whose length is not the sample time of the session.
    #[error("the step of {step} s is not the sample time of the session with {peer}, {sample_time} s")]
    Step { peer: Address, step: f64, sample_time: f64 },
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

/// Why a server cannot continue.
#[derive(Debug, Error)]
pub enum ServerError {
    /// Its rig failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// Its controller failed.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The network failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The system failed.
    #[error("the network: {0}")]
    System(#[from] io::Error),
}
