//! A master that makes no other use of an instance than it is told to, and passes on what the instance logs.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::fmt;

use fmi2_component::abi::CallbackFunctions;
use fmi2_component::{Logger, Status};

use crate::functions::{Answer, Functions, Raw};

/// `fmi2Type`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub enum Interface {
    ModelExchange = 0,
    CoSimulation = 1,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// How the call ends.
    pub status: Status,
    /// The log category; empty where the FMU gives none.
    pub category: String,
    /// The message.
    pub text: String,
}

/// What takes the lines of a log.
pub type Hear = Box<dyn FnMut(Line) + Send>;

unsafe extern "C" {
    /// In logger.c.
    fn vines_fmi2_logger(
        environment: *mut c_void,
        instance: *const c_char,
        status: Status,
        category: *const c_char,
        message: *const c_char,
        ...
    );
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// Called by logger.c with the complete message.
#[unsafe(no_mangle)]
unsafe extern "C" fn vines_fmi2_line(
    environment: *mut c_void,
    status: Answer,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: texts end with NUL and live until this function returns; the environment is that of the master.
    unsafe {
        let read = |from: *const c_char| match from.is_null() {
            true => String::new(),
            false => CStr::from_ptr(from).to_string_lossy().into_owned(),
        };
        let line = Line {
            status: status.into(),
            category: read(category),
            text: read(text),
        };
        (*environment.cast::<Hear>())(line);
    }
}

/// An instance.
pub struct Master {
    /// The instance; NULL where it was refused.
    pub c: Raw,
    /// The library's functions.
    pub f: Functions,
    hear: *mut Hear,
    _callbacks: Box<CallbackFunctions>,
}

// SAFETY: an instance may be called from changing threads, one at a time.
unsafe impl Send for Master {}

impl Master {
    /// An instance, or the refusal of one: `fmi2Instantiate` with these arguments, invisible. `hear` takes its log.
    ///
    /// # Safety
    /// The texts end with NUL or are NULL. The library of the functions must stay loaded until this is dropped. Where `c` is NULL, only such libraries may be
    /// called as check their arguments.
    #[must_use]
    pub unsafe fn new(
        f: Functions,
        name: *const c_char,
        kind: c_int,
        guid: *const c_char,
        location: *const c_char,
        logging: bool,
        hear: Hear,
    ) -> Self {
        let hear = Box::into_raw(Box::new(hear));
        let callbacks = Box::new(CallbackFunctions {
            logger: Some(vines_fmi2_logger as Logger),
            allocate_memory: Some(calloc),
            free_memory: Some(free),
            step_finished: None,
            component_environment: hear.cast(),
        });
        // SAFETY: as promised by the caller; the callbacks and their environment outlive the instance.
        let c = unsafe { (f.fmi2Instantiate)(name, kind, guid, location, &*callbacks, 0, logging.into()) };
        Self { c, f, hear, _callbacks: callbacks }
    }

    /// Takes the instance from its instantiation through initialisation, from t = 0 s without an end, and answers the
    /// first call that was not done or else the last.
    pub fn start(&self) -> Answer {
        // SAFETY: the instance is alive.
        unsafe {
            let set_up = (self.f.fmi2SetupExperiment)(self.c, 0, 0.0, 0.0, 0, 0.0);
            if !set_up.is_done() {
                return set_up;
            }
            let entered = (self.f.fmi2EnterInitializationMode)(self.c);
            if !entered.is_done() {
                return entered;
            }
            (self.f.fmi2ExitInitializationMode)(self.c)
        }
    }

    /// Takes a step, s.
    pub fn step(&self, time: f64, step: f64) -> Answer {
        // SAFETY: the instance is alive.
        unsafe { (self.f.fmi2DoStep)(self.c, time, step, 1) }
    }
}

/// Declares how variables of a type are read and set.
macro_rules! values {
    ($($get:ident, $set:ident, $type:ty, $read:ident, $write:ident;)*) => {
        #[expect(missing_docs, reason = "each calls the function of the standard")]
        impl Master {
            $(
                pub fn $read(&self, references: &[u32], values: &mut [$type]) -> Answer {
                    assert_eq!(references.len(), values.len());
                    // SAFETY: the instance is alive, and there are as many places as references.
                    unsafe { (self.f.$get)(self.c, references.as_ptr(), references.len(), values.as_mut_ptr()) }
                }

                pub fn $write(&self, references: &[u32], values: &[$type]) -> Answer {
                    assert_eq!(references.len(), values.len());
                    // SAFETY: the instance is alive, and there are as many values as references.
                    unsafe { (self.f.$set)(self.c, references.as_ptr(), references.len(), values.as_ptr()) }
                }
            )*
        }
    };
}

values! {
    fmi2GetReal, fmi2SetReal, f64, get_reals, set_reals;
    fmi2GetInteger, fmi2SetInteger, c_int, get_integers, set_integers;
    fmi2GetBoolean, fmi2SetBoolean, c_int, get_booleans, set_booleans;
}

impl Drop for Master {
    fn drop(&mut self) {
        // SAFETY: the log's receiver came out of a box, and after the instance nobody uses it.
        unsafe {
            (self.f.fmi2FreeInstance)(self.c);
            drop(Box::from_raw(self.hear));
        }
    }
}

impl fmt::Debug for Master {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Master").field("c", &self.c).finish_non_exhaustive()
    }
}
