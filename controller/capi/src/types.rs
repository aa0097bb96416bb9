//! The types of the header that C needs and the core does not have. The units are m, s, rad, rad/s.

use phase_lock::{PhaseLock, State, Value};

/// The floating-point type: float if PHASE_LOCK_F32 is defined, for the library with the feature f32; otherwise double.
#[cfg(feature = "f32")]
pub type PhaseLockReal = f32;
/// The floating-point type: float if PHASE_LOCK_F32 is defined, for the library with the feature f32; otherwise double.
#[cfg(not(feature = "f32"))]
pub type PhaseLockReal = f64;

/// Storage of a controller and its state, initialised by phase_lock_init. May be copied; its content is private.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PhaseLockController {
    /// Opaque.
    pub words: [u64; 384],
}

/// Content of the storage.
#[derive(Clone, Copy)]
pub(crate) struct Stored {
    pub lock: PhaseLock,
    pub state: State,
}

const _: () = assert!(size_of::<Stored>() <= size_of::<PhaseLockController>());
const _: () = assert!(align_of::<Stored>() <= align_of::<PhaseLockController>());

/// An optional value; all zeros: none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseLockOptional {
    /// Whether there is a value.
    pub present: bool,
    /// The value.
    pub value: PhaseLockReal,
}

/// Method of the phase detector.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhaseLockDetector {
    /// Adaptive harmonic filter.
    #[default]
    Adaptive = 1,
    /// Synchronous demodulation.
    Demodulator = 2,
}

impl From<PhaseLockOptional> for Option<PhaseLockReal> {
    fn from(c: PhaseLockOptional) -> Self {
        c.present.then_some(c.value)
    }
}

impl From<Option<PhaseLockReal>> for PhaseLockOptional {
    fn from(value: Option<PhaseLockReal>) -> Self {
        Self { present: value.is_some(), value: value.unwrap_or_default() }
    }
}

impl From<PhaseLockOptional> for Value {
    fn from(c: PhaseLockOptional) -> Self {
        Option::from(c).into()
    }
}

impl From<Value> for PhaseLockOptional {
    fn from(value: Value) -> Self {
        Option::from(value).into()
    }
}
