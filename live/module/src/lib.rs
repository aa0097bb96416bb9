//! The live bench: plant, phase-locked loop and theory behind plain C exports, for a page in a browser.
//!
//! The page and the module exchange numbers through arrays whose addresses the exports return. `lab/page/settings.json` lists the
//! settings; [`exports`] lists the columns of the other arrays. All computation is that of the crates `lovines`, `phase-lock`,
//! `vines-model` and `vines-testbench`: this crate only runs them sample by sample.

pub mod bench;
pub mod exports;
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

/// The mathematical functions that the standard library calls, from the crate that plant and controller use: one copy instead of two.
#[cfg(target_arch = "wasm32")]
mod mathematics {
    // SAFETY of the names: they are those of the C library, with its signatures; the compiler's own are weak.
    macro_rules! functions {
        ($($name:ident($($argument:ident),*))*) => {
            $(
                #[unsafe(no_mangle)]
                extern "C" fn $name($($argument: f64),*) -> f64 {
                    libm::$name($($argument),*)
                }
            )*
        };
    }

    functions! {
        sin(x) cos(x) exp(x) log(x) atan(x) atan2(y, x) hypot(x, y)
    }
}
