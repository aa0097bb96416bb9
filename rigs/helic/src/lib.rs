//! The control protocol of [helic-daq](https://github.com/dawbarton/helic-daq), version 3: a rig as one of its devices ([`Device`],
//! [`serve`]), and its devices as rigs ([`HelicRig`]).
//!
//! Source of all facts: `docs/protocol.md` of that project.
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod client;
pub mod codec;
mod device;

pub use client::{HelicRig, LONGEST_SILENCE, Network, Transport};
pub use device::{DEFAULT_PORT, Device, listen, serve};
