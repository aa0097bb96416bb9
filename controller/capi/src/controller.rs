//! The functions of the header. Each returns 0 where it succeeds, 1 for a value that is refused and -1 for a NULL pointer.

use core::ffi::{c_char, c_int};

use phase_lock::{Config, ConfigError};

use crate::message;
use crate::types::{
    PhaseLockConfig, PhaseLockController, PhaseLockInput, PhaseLockMove, PhaseLockOutput, Stored,
};

const DONE: c_int = 0;
const REFUSED: c_int = 1;
const NO_POINTER: c_int = -1;

/// What is stored behind the pointer.
///
/// # Safety
/// `controller` is NULL or was set up by [`phase_lock_init`].
unsafe fn stored<'a>(controller: *mut PhaseLockController) -> Option<&'a mut Stored> {
    // SAFETY: the storage is large and aligned enough (asserted beside its type) and holds what phase_lock_init wrote.
    unsafe { controller.cast::<Stored>().as_mut() }
}

/// # Safety
/// `message` is NULL or points to `length` bytes that may be written.
unsafe fn answer(outcome: Result<(), ConfigError>, message: *mut c_char, length: usize) -> c_int {
    match outcome {
        Ok(()) => DONE,
        Err(error) => {
            // SAFETY: the caller's promise.
            unsafe { message::write(error, message, length) };
            REFUSED
        }
    }
}

/// Fills in a sensible start for a structure that resonates near omega (rad/s) and a base of the given amplitude (m).
///
/// # Safety
/// config is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_config_for_resonance(
    config: *mut PhaseLockConfig,
    omega: f64,
    amplitude: f64,
) -> c_int {
    if config.is_null() {
        return NO_POINTER;
    }
    let sensible = PhaseLockConfig::from(&Config::for_resonance(omega, amplitude));
    // SAFETY: the caller's promise.
    unsafe { config.write(sensible) };
    DONE
}

/// Checks a configuration and sets up a controller before its first sample. Where a value is refused the reason is
/// written to message (of that length in bytes, NULL for none), and the controller is left as it was.
///
/// # Safety
/// controller and message may be written, config may be read; each of them may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_init(
    controller: *mut PhaseLockController,
    config: *const PhaseLockConfig,
    message: *mut c_char,
    length: usize,
) -> c_int {
    // SAFETY: the caller's promise.
    let Some(config) = (unsafe { config.as_ref() }) else {
        return NO_POINTER;
    };
    if controller.is_null() {
        return NO_POINTER;
    }
    let built = Config::from(config).build().map(|lock| Stored {
        state: lock.start(),
        lock,
    });
    // SAFETY: the storage is large and aligned enough, and may be written.
    let outcome = built.map(|stored| unsafe { controller.cast::<Stored>().write(stored) });
    // SAFETY: the caller's promise.
    unsafe { answer(outcome, message, length) }
}

/// Takes what the sensors read now, puts out what the drive shall be until the next sample. To be called every sample_time.
///
/// # Safety
/// controller is NULL or was set up, input is NULL or may be read, output is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_sample(
    controller: *mut PhaseLockController,
    input: *const PhaseLockInput,
    output: *mut PhaseLockOutput,
) -> c_int {
    // SAFETY: the caller's promise.
    let (Some(stored), Some(input)) = (unsafe { (stored(controller), input.as_ref()) }) else {
        return NO_POINTER;
    };
    if output.is_null() {
        return NO_POINTER;
    }
    let put_out = stored.lock.process(&mut stored.state, input.into());
    // SAFETY: the caller's promise.
    unsafe { output.write(put_out.into()) };
    DONE
}

/// Changes drive amplitude (m) and phase target (rad) between samples; the state goes on.
///
/// # Safety
/// As for phase_lock_init.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_retune(
    controller: *mut PhaseLockController,
    amplitude: f64,
    phase_target: f64,
    message: *mut c_char,
    length: usize,
) -> c_int {
    // SAFETY: the caller's promise.
    let Some(stored) = (unsafe { stored(controller) }) else {
        return NO_POINTER;
    };
    let outcome = stored.lock.retune(amplitude, phase_target);
    // SAFETY: the caller's promise.
    unsafe { answer(outcome, message, length) }
}

/// Holds the amplitude of the response from now on and moves it as stated; the drive does what it must, within its limits.
///
/// # Safety
/// As for phase_lock_init; to is NULL or may be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_hold_response(
    controller: *mut PhaseLockController,
    to: *const PhaseLockMove,
    message: *mut c_char,
    length: usize,
) -> c_int {
    // SAFETY: the caller's promise.
    let (Some(stored), Some(to)) = (unsafe { (stored(controller), to.as_ref()) }) else {
        return NO_POINTER;
    };
    let outcome = stored.lock.hold_response(&mut stored.state, to.into());
    // SAFETY: the caller's promise.
    unsafe { answer(outcome, message, length) }
}

/// Back to before the first sample, with the configuration as it is.
///
/// # Safety
/// controller is NULL or was set up.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_reset(controller: *mut PhaseLockController) -> c_int {
    // SAFETY: the caller's promise.
    let Some(stored) = (unsafe { stored(controller) }) else {
        return NO_POINTER;
    };
    stored.state = stored.lock.start();
    DONE
}
