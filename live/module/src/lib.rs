//! The live bench: plant, phase-locked loop and theory behind plain C exports, for a page in a browser.
//!
//! The page and the module exchange numbers through arrays whose addresses the exports return. `live/settings.json` lists the
//! settings; [`exports`] lists the columns of the other arrays. All computation is that of the crates `lovines`, `phase-lock`,
//! `vines-model` and `vines-testbench`: this crate only runs them sample by sample.

pub mod bench;
pub mod exports;
#[cfg(target_arch = "wasm32")]
mod mathematics;
pub mod message;
mod rig;
pub mod settings;
mod tracking;

#[cfg(target_arch = "wasm32")]
use lol_alloc::{AssumeSingleThreaded, FreeListAllocator};

// SAFETY: a page calls the module from one thread, and the module starts none.
#[cfg(target_arch = "wasm32")]
#[global_allocator]
static ALLOCATOR: AssumeSingleThreaded<FreeListAllocator> =
    unsafe { AssumeSingleThreaded::new(FreeListAllocator::new()) };
