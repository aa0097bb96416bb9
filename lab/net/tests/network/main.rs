//! The network door on loopback: what arrives well, what does not, and what is refused.

mod bench;
mod controller;
mod lock_step;
mod proxy;
mod real_time;
mod refusals;
