//! The control protocol of [helic-daq](https://github.com/dawbarton/helic-daq), version 3: a rig as one of its devices, and its devices
//! as rigs.
//!
//! Source of all facts: `docs/protocol.md` of that project (version 3), and for the phase-locked loop the documents
//! `docs/standard_control_and_pll.md` and `docs/control.md` of its rigs. `docs/helic.md` of this project says what is served.

pub mod codec;
mod device;
mod generator;
mod host;
mod pll;
mod registry;
mod rig_client;
mod server;
mod settings;
mod stream;
mod transport;
mod watchdog;

pub use device::Device;
pub use host::{Host, HostError};
pub use rig_client::{Channels, HelicRig};
pub use server::{DEFAULT_PORT, HelicServer};
pub use transport::{LONGEST_SILENCE, Network, Transport};
