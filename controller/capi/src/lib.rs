//! The phase-lock controller for C: the same core with C types.
//!
//! There is no allocation and no global state: the caller provides the storage, a [`PhaseLockController`]. A copy of it is
//! a copy of the controller. The header is `include/phase_lock.h`; `docs/firmware.md` explains how to build and use it.
//! Each function returns 0 for success, 1 for an invalid value and -1 for a NULL pointer.
#![cfg_attr(not(feature = "std"), no_std)]
#![warn(missing_docs)]

use core::ffi::{c_char, c_int};
use core::fmt::{Display, Write};

use phase_lock::{Config, ConfigError, PARAMETERS, Value};

mod types;

use types::Stored;
pub use types::{
    PhaseLockConfig, PhaseLockController, PhaseLockDetector, PhaseLockFault, PhaseLockInput, PhaseLockMove,
    PhaseLockOptional, PhaseLockOutput, PhaseLockReal, PhaseLockStage,
};

/// Conversions of the configuration in both directions. Every parameter of the table is a field of the same name.
macro_rules! conversions {
    ($initial:tt $($group:ident { $($(#[doc = $doc:literal])+ $field:ident: $type:ty = $value:expr, $unit:literal, $range:ident;)* })*) => {
        impl TryFrom<&PhaseLockConfig> for Config {
            type Error = ConfigError;

            fn try_from(c: &PhaseLockConfig) -> Result<Self, ConfigError> {
                let mut config = Self::for_resonance(1.0, 1.0);
                let values: [Value; PARAMETERS.len()] = [$($(c.$field.into(),)*)*];
                for (parameter, value) in PARAMETERS.iter().zip(values) {
                    parameter.set(&mut config, value)?;
                }
                Ok(config)
            }
        }

        impl From<&Config> for PhaseLockConfig {
            fn from(config: &Config) -> Self {
                let [$($($field,)*)*] = PARAMETERS.each_ref().map(|parameter| parameter.get(config));
                Self { $($($field: $field.into(),)*)* }
            }
        }
    };
}

phase_lock::parameters!(conversions);

const SUCCESS: c_int = 0;
const INVALID_VALUE: c_int = 1;
const NULL_POINTER: c_int = -1;

/// Content of the storage behind the pointer.
///
/// # Safety
/// `controller` is NULL or was initialised by [`phase_lock_init`].
unsafe fn stored<'a>(controller: *mut PhaseLockController) -> Option<&'a mut Stored> {
    // SAFETY: the storage is large and aligned enough (asserted beside its type) and holds what phase_lock_init wrote.
    unsafe { controller.cast::<Stored>().as_mut() }
}

/// # Safety
/// `message` is NULL or points to `length` bytes that may be written.
unsafe fn status(outcome: Result<(), ConfigError>, message: *mut c_char, length: usize) -> c_int {
    match outcome {
        Ok(()) => SUCCESS,
        Err(error) => {
            // SAFETY: the caller's contract.
            unsafe { write_message(error, message, length) };
            INVALID_VALUE
        }
    }
}

/// Writes suitable initial values for a structure with a resonance near omega (rad/s) and a base amplitude in m.
///
/// # Safety
/// config is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_config_for_resonance(
    config: *mut PhaseLockConfig,
    omega: PhaseLockReal,
    amplitude: PhaseLockReal,
) -> c_int {
    if config.is_null() {
        return NULL_POINTER;
    }
    let initial = PhaseLockConfig::from(&Config::for_resonance(omega, amplitude));
    // SAFETY: the caller's contract.
    unsafe { config.write(initial) };
    SUCCESS
}

/// Checks a configuration and initialises a controller before its first sample. For an invalid value, writes the reason to
/// message (of that length in bytes; may be NULL) and leaves the controller unchanged.
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
    // SAFETY: the caller's contract.
    let Some(config) = (unsafe { config.as_ref() }) else {
        return NULL_POINTER;
    };
    if controller.is_null() {
        return NULL_POINTER;
    }
    let built = Config::try_from(config)
        .and_then(Config::build)
        .map(|lock| Stored { state: lock.start(), lock });
    // SAFETY: the storage is large and aligned enough, and may be written.
    let outcome = built.map(|stored| unsafe { controller.cast::<Stored>().write(stored) });
    // SAFETY: the caller's contract.
    unsafe { status(outcome, message, length) }
}

/// One sample: takes the sensor readings, returns the drive until the next sample. Call it every sample_time.
///
/// # Safety
/// controller is NULL or was initialised, input is NULL or may be read, output is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_sample(
    controller: *mut PhaseLockController,
    input: *const PhaseLockInput,
    output: *mut PhaseLockOutput,
) -> c_int {
    // SAFETY: the caller's contract.
    let (Some(stored), Some(input)) = (unsafe { (stored(controller), input.as_ref()) }) else {
        return NULL_POINTER;
    };
    if output.is_null() {
        return NULL_POINTER;
    }
    let result = stored.lock.process(&mut stored.state, input.into());
    // SAFETY: the caller's contract.
    unsafe { output.write(result.into()) };
    SUCCESS
}

/// Changes drive amplitude (m) and phase target (rad) between samples; the state continues.
///
/// # Safety
/// As for phase_lock_init.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_retune(
    controller: *mut PhaseLockController,
    amplitude: PhaseLockReal,
    phase_target: PhaseLockReal,
    message: *mut c_char,
    length: usize,
) -> c_int {
    // SAFETY: the caller's contract.
    let Some(stored) = (unsafe { stored(controller) }) else {
        return NULL_POINTER;
    };
    let outcome = stored.lock.retune(amplitude, phase_target);
    // SAFETY: the caller's contract.
    unsafe { status(outcome, message, length) }
}

/// Controls the response amplitude from now on and moves it to another setpoint; the drive follows within its limits.
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
    // SAFETY: the caller's contract.
    let (Some(stored), Some(to)) = (unsafe { (stored(controller), to.as_ref()) }) else {
        return NULL_POINTER;
    };
    let outcome = stored.lock.hold_response(&mut stored.state, to.into());
    // SAFETY: the caller's contract.
    unsafe { status(outcome, message, length) }
}

/// Controls the drive amplitude again; the drive ramps to its setpoint.
///
/// # Safety
/// controller is NULL or was initialised.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_hold_drive(controller: *mut PhaseLockController) -> c_int {
    // SAFETY: the caller's contract.
    let Some(stored) = (unsafe { stored(controller) }) else {
        return NULL_POINTER;
    };
    stored.lock.hold_drive(&mut stored.state);
    SUCCESS
}

/// Returns to the state before the first sample, with the same configuration.
///
/// # Safety
/// controller is NULL or was initialised.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phase_lock_reset(controller: *mut PhaseLockController) -> c_int {
    // SAFETY: the caller's contract.
    let Some(stored) = (unsafe { stored(controller) }) else {
        return NULL_POINTER;
    };
    stored.state = stored.lock.start();
    SUCCESS
}

/// A buffer of fixed length; text that does not fit is omitted.
struct Buffer<'a> {
    bytes: &'a mut [u8],
    used: usize,
}

impl Write for Buffer<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let free = self.bytes.len() - 1 - self.used;
        let mut taken = text.len().min(free);
        while !text.is_char_boundary(taken) {
            taken -= 1;
        }
        self.bytes[self.used..self.used + taken].copy_from_slice(&text.as_bytes()[..taken]);
        self.used += taken;
        Ok(())
    }
}

/// Writes as much of `text` as fits into `length` bytes, with a terminating zero.
///
/// # Safety
/// `to` is NULL or points to `length` bytes that may be written.
unsafe fn write_message(text: impl Display, to: *mut c_char, length: usize) {
    if to.is_null() || length == 0 {
        return;
    }
    // SAFETY: the caller's contract.
    let bytes = unsafe { core::slice::from_raw_parts_mut(to.cast::<u8>(), length) };
    bytes.fill(0);
    let mut buffer = Buffer { bytes, used: 0 };
    // A full buffer is not an error.
    let _ = write!(buffer, "{text}");
}

#[cfg(not(feature = "std"))]
#[panic_handler]
fn halt(_: &core::panic::PanicInfo) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

#[cfg(test)]
mod tests {
    use core::mem::MaybeUninit;
    use core::ptr::{null, null_mut};

    use phase_lock::Detector;

    use super::*;

    #[test]
    fn every_parameter_survives_the_way_to_c_and_back() {
        for detector in [Detector::Adaptive, Detector::Demodulator] {
            let mut config = Config::for_resonance(55.0, 1e-4);
            config.detector = detector;
            for (n, parameter) in PARAMETERS.iter().enumerate() {
                let value = match parameter.get(&config) {
                    Value::Real(_) => Value::Real(1.0 + n as PhaseLockReal),
                    Value::Integer(_) if parameter.name != "detector" => Value::Integer(5),
                    same => same,
                };
                parameter.set(&mut config, value).expect(parameter.name);
            }
            let c = PhaseLockConfig::from(&config);
            assert_eq!(Config::try_from(&c), Ok(config));
            assert_eq!(PhaseLockConfig::from(&config), c);
        }
    }

    #[test]
    fn a_detector_that_does_not_exist_is_refused() {
        let mut c = PhaseLockConfig::from(&Config::for_resonance(55.0, 1e-4));
        for detector in [-1, 0, 3, 4, 5, i32::MAX] {
            c.detector = detector;
            let refused = Config::try_from(&c).unwrap_err();
            let value = refused.value.map(|value| value as i32);
            assert_eq!((refused.name, value), ("detector", Some(detector)));
        }
    }

    #[test]
    fn a_message_that_does_not_fit_is_cut_at_a_character_and_terminated_and_one_of_a_large_value_fits() {
        let mut bytes = [0x7f_u8; 8];
        // SAFETY: as many bytes as the array has; so below.
        unsafe { write_message("größe", bytes.as_mut_ptr().cast(), 4) };
        assert_eq!(bytes[..5], *b"gr\0\0\x7f");
        let mut config = phase_lock::Config::for_resonance(55.0, 1e-4);
        config.sample_time = -1e30;
        let mut bytes = [0_u8; 200];
        unsafe { write_message(config.build().unwrap_err(), bytes.as_mut_ptr().cast(), bytes.len()) };
        let text = core::ffi::CStr::from_bytes_until_nul(&bytes).unwrap().to_str().unwrap();
        assert!(text.starts_with("sample_time = -1e30 s") && text.contains("allowed is above 0"));
    }

    /// For Miri, which cannot run a C program: its calls, and a copy of the storage as memcpy makes it.
    #[test]
    fn a_controller_runs_through_pointers_and_a_copy_of_its_bytes_continues_as_it_does() {
        let mut config = MaybeUninit::uninit();
        let mut storage = [const { MaybeUninit::<PhaseLockController>::uninit() }; 2];
        let [one, copy] = storage.each_mut().map(MaybeUninit::as_mut_ptr);
        let mut bytes = [0_u8; 200];
        let length = bytes.len();
        let message = bytes.as_mut_ptr().cast::<c_char>();
        let sample = |controller, n: u16| {
            let response = 1e-3 * (0.05 * PhaseLockReal::from(n)).sin();
            let reference = PhaseLockOptional { present: true, value: 0.1 * response };
            let input = PhaseLockInput { response, reference, active: true };
            let mut output = MaybeUninit::<PhaseLockOutput>::uninit();
            // SAFETY: the controller has been initialised, and the call writes the output.
            unsafe {
                assert_eq!(
                    phase_lock_sample(controller, &raw const input, output.as_mut_ptr()),
                    SUCCESS
                );
                output.assume_init()
            }
        };
        // SAFETY: the pointers are those of places of their types.
        unsafe {
            assert_eq!(
                phase_lock_config_for_resonance(config.as_mut_ptr(), 55.0, 1e-4),
                SUCCESS
            );
            let mut config = config.assume_init();
            config.amplitude_max = PhaseLockOptional { present: true, value: 4e-4 };
            assert_eq!(phase_lock_init(one, &raw const config, message, length), SUCCESS);
            for n in 0..50 {
                sample(one, n);
            }
            copy.copy_from_nonoverlapping(one, 1);
            for n in 50..100 {
                assert_eq!(sample(one, n), sample(copy, n));
            }
            let mut to = PhaseLockMove {
                response: 1e-3,
                duration: 1.0,
                amplitude: 0.0,
                omega: 0.0,
                growth: 0.0,
            };
            assert_eq!(phase_lock_hold_response(one, &raw const to, message, length), SUCCESS);
            to.response = -1.0;
            assert_eq!(
                phase_lock_hold_response(one, &raw const to, message, length),
                INVALID_VALUE
            );
            assert_ne!(*message, 0);
            assert_eq!(phase_lock_hold_drive(one), SUCCESS);
            assert_eq!(phase_lock_retune(one, 2e-4, -1.0, null_mut(), 0), SUCCESS);
            assert_eq!(phase_lock_reset(copy), SUCCESS);
            config.sample_time = -1.0;
            assert_eq!(phase_lock_init(copy, &raw const config, null_mut(), 0), INVALID_VALUE);
            let fresh = sample(copy, 0);
            assert_eq!((fresh.locked, fresh.fault), (false, PhaseLockFault::None));
            assert_eq!(
                phase_lock_init(null_mut(), &raw const config, message, length),
                NULL_POINTER
            );
            assert_eq!(phase_lock_sample(null_mut(), null(), null_mut()), NULL_POINTER);
            assert_eq!(phase_lock_hold_response(one, null(), message, length), NULL_POINTER);
            assert_eq!(phase_lock_reset(null_mut()), NULL_POINTER);
        }
    }
}
