//! Rigs and controllers on loopback: correct, lost, late and invalid frames, and refused sessions.

mod bench;
mod controller;
mod lock_step;
mod proxy;
mod real_time;
mod refusals;
