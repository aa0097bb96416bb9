//! An instance for co-simulation.

use std::ffi::{CString, c_int, c_void};

use fmi2_description::Description;
use libloading::Library;

use crate::error::{CallError, LoadError};
use crate::fmu::Fmu;
use crate::functions::{Callbacks, Component, Functions};
use crate::logger::{SINK, fmi2_import_logger};

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;

/// An instance of an FMU. It is freed when it is dropped.
pub struct Instance {
    component: Component,
    functions: Functions,
    /// An FMU may keep the pointer to its callbacks.
    _callbacks: Box<Callbacks>,
    // The fields below are dropped after the instance has been freed.
    _library: Library,
    fmu: Fmu,
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the component is valid, and nobody uses it afterwards.
        unsafe { (self.functions.fmi2FreeInstance)(self.component) };
    }
}

/// Declares setters and getters for one type.
macro_rules! values {
    ($set:ident, $c_set:ident, $get:ident, $c_get:ident, $value:ty) => {
        /// Sets variables by their value references.
        ///
        /// # Errors
        /// The status of a call that failed.
        ///
        /// # Panics
        /// If the numbers of references and values differ.
        pub fn $set(&mut self, references: &[u32], values: &[$value]) -> Result<(), CallError> {
            assert_eq!(references.len(), values.len());
            let (references, count) = (references.as_ptr(), references.len());
            // SAFETY: the component is valid, and both arrays have `count` elements.
            status(unsafe { (self.functions.$c_set)(self.component, references, count, values.as_ptr()) })
        }

        /// Reads variables by their value references.
        ///
        /// # Errors
        /// The status of a call that failed.
        ///
        /// # Panics
        /// If the numbers of references and values differ.
        pub fn $get(&mut self, references: &[u32], values: &mut [$value]) -> Result<(), CallError> {
            assert_eq!(references.len(), values.len());
            let (references, count) = (references.as_ptr(), references.len());
            // SAFETY: the component is valid, and both arrays have `count` elements.
            status(unsafe { (self.functions.$c_get)(self.component, references, count, values.as_mut_ptr()) })
        }
    };
}

impl Instance {
    /// Loads the library of the FMU and instantiates it, with logging on. `name` is the name in its log messages.
    ///
    /// # Errors
    /// A library that cannot be loaded, or does not instantiate.
    pub fn new(fmu: Fmu, name: &str) -> Result<Self, LoadError> {
        // SAFETY: running the code of the FMU is what the caller asks for.
        let library = unsafe { Library::new(fmu.library()?)? };
        // SAFETY: the library stays loaded as long as the instance exists.
        let functions = unsafe { Functions::load(&library)? };
        let callbacks = Box::new(Callbacks {
            logger: fmi2_import_logger,
            allocate_memory: calloc,
            free_memory: free,
            step_finished: None,
            component_environment: (&raw const SINK).cast(),
        });
        // A NUL byte ends a C string; no valid name, GUID or URI contains one.
        let text = |text: &str| CString::new(text.replace('\0', "")).unwrap_or_default();
        let (name, guid) = (text(name), text(&fmu.description().guid));
        let resources = text(&fmu.resources());
        // SAFETY: all pointers are valid during the call, the callbacks as long as the instance exists.
        let component = unsafe {
            (functions.fmi2Instantiate)(
                name.as_ptr(),
                CO_SIMULATION,
                guid.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                0,
                1,
            )
        };
        if component.is_null() {
            return Err(LoadError::Instantiate);
        }
        Ok(Self {
            component,
            functions,
            _callbacks: callbacks,
            _library: library,
            fmu,
        })
    }

    /// The description of the FMU.
    #[must_use]
    pub fn description(&self) -> &Description {
        self.fmu.description()
    }

    /// Initializes the instance at time 0 without tolerance and stop time.
    ///
    /// # Errors
    /// The status of a call that failed.
    pub fn initialize(&mut self) -> Result<(), CallError> {
        // SAFETY: the component is valid.
        unsafe {
            let c = self.component;
            status((self.functions.fmi2SetupExperiment)(c, 0, 0.0, 0.0, 0, 0.0))?;
            status((self.functions.fmi2EnterInitializationMode)(c))?;
            status((self.functions.fmi2ExitInitializationMode)(c))
        }
    }

    /// One communication step from `time`, s, of length `step`, s.
    ///
    /// # Errors
    /// The status of a call that failed.
    pub fn do_step(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        // SAFETY: the component is valid.
        status(unsafe { (self.functions.fmi2DoStep)(self.component, time, step, 1) })
    }

    values!(set_real, fmi2SetReal, get_real, fmi2GetReal, f64);
    values!(set_integer, fmi2SetInteger, get_integer, fmi2GetInteger, i32);
    values!(set_boolean, fmi2SetBoolean, get_boolean, fmi2GetBoolean, i32);
}

fn status(status: c_int) -> Result<(), CallError> {
    match status {
        0 | 1 => Ok(()),
        2 => Err(CallError::Discard),
        3 => Err(CallError::Error),
        other => Err(CallError::Fatal(other)),
    }
}
