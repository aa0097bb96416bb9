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
    #[error("{address} is not an address: {message}")]
    Address { address: String, message: String },
    #[error(
        "{address} is not a loopback address. Use --key on both sides; without it, everyone who can reach the address can drive the \
         rig, so use --allow-remote only on a network where everyone may do so"
    )]
    Remote { address: SocketAddr },
    #[error("cannot listen on {address}: {source}")]
    Listen { address: Address, source: io::Error },
    #[error("no answer from {peer} within {seconds} s: is `{command}` running there, with the same --key or none?")]
    Unreachable {
        peer: Address,
        command: String,
        seconds: f64,
    },
    #[error(
        "{peer} has version {theirs} of the protocol, this program has version {VERSION}: use the same release of both"
    )]
    Version { peer: Address, theirs: u16 },
    #[error("{peer} refuses: {reason}")]
    Refused { peer: Address, reason: Refusal },
    #[error(
        "{peer} measures {theirs}, the [resonance] section of the scene needs {ours}: use the same scene for both, or set resonance.sensor \
         and resonance.reference to what the rig measures"
    )]
    Sensors {
        peer: Address,
        theirs: String,
        ours: String,
    },
    #[error(
        "nothing has arrived from {peer} for {seconds} s, at t = {time:.3} s of the experiment: it is too slow or has ended, or the network is down"
    )]
    Silent { peer: Address, seconds: f64, time: f64 },
    #[error(
        "{samples} readings of {peer} were lost in the network or came too late, {seconds:.3} s, at t = {time:.3} s of the experiment; gaps of \
         up to {allowed} s are bridged"
    )]
    Blackout {
        peer: Address,
        samples: u64,
        seconds: f64,
        allowed: f64,
        time: f64,
    },
    #[error(
        "{peer} has shut down its drive, at t = {time:.3} s of the experiment: it was stopped, or no drive of this program reached it for \
         more than {seconds} s, because the network lost them, or this machine was too slow"
    )]
    ShutDown { peer: Address, time: f64, seconds: f64 },
    #[error(
        "{peer} has closed the connection, at t = {time:.3} s of the experiment: it was stopped, or received nothing for too long"
    )]
    Closed { peer: Address, time: f64 },
    #[error(
        "{peer} sent a frame that is damaged, has a value that is not allowed, or is not the answer, at t = {time} s of the experiment"
    )]
    Invalid { peer: Address, time: f64 },
    #[error("the step of {step} s is not the sample time of the session with {peer}, {sample_time} s")]
    Step { peer: Address, step: f64, sample_time: f64 },
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
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ServerError {
    #[error(transparent)]
    Rig(#[from] RigError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error("the network: {0}")]
    System(#[from] io::Error),
}
