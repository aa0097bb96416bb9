//! The helic protocol: its published vectors, the device, and the device as a rig.

mod device;
mod host;
mod network;
mod rig;
mod vectors;
