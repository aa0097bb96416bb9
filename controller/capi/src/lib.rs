//! The phase-lock controller for C: the same core with C types.
//!
//! There is no allocation and no global state: the caller provides the storage, a [`PhaseLockController`]. A copy of it is
//! a copy of the controller. The header is `include/phase_lock.h`; `docs/firmware.md` explains how to build and use it.
#![cfg_attr(not(feature = "std"), no_std)]
#![warn(missing_docs)]

// Single precision under the same name.
#[cfg(feature = "f32")]
extern crate phase_lock_f32 as phase_lock;

mod controller;
mod convert;
mod message;
mod types;

pub use controller::{
    phase_lock_config_for_resonance, phase_lock_hold_drive, phase_lock_hold_response, phase_lock_init,
    phase_lock_reset, phase_lock_retune, phase_lock_sample,
};
pub use types::{
    PhaseLockConfig, PhaseLockController, PhaseLockDetector, PhaseLockFault, PhaseLockInput, PhaseLockMove,
    PhaseLockOptional, PhaseLockOutput, PhaseLockReal, PhaseLockStage,
};

#[cfg(not(feature = "std"))]
#[panic_handler]
fn halt(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
