//! The library of an FMU: its C functions, an instance, and what that logs.
//!
//! `libloading` loads it. The contract of every call is that of the standard: the library is one of FMI 2.0 whose functions have these
//! types, and the instance is alive.

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Mutex;

use fmi2_description::FmiType;
use libloading::Library;

use crate::archive::Unpacked;
use crate::process::WorkingFolder;

/// `fmi2Component`.
type Component = *mut c_void;
/// `fmi2Status`. Not an enumeration: a library may return any number.
type Status = c_int;
const WARNING: Status = 1;
/// Messages that are passed on; a full pipe that nobody reads must not stop the loop.
const MESSAGES: u32 = 20;
/// Characters of a message that are passed on.
const LENGTH: usize = 300;

/// `fmi2CallbackFunctions`.
#[repr(C)]
struct Callbacks {
    logger: unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, ...),
    allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free_memory: unsafe extern "C" fn(*mut c_void),
    step_finished: Option<unsafe extern "C" fn(*mut c_void, Status)>,
    environment: *const Log,
}

unsafe extern "C" {
    /// In logger.c.
    fn vines_fmu_logger(
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
extern "C" fn vines_fmu_log(environment: *const c_void, status: c_int, message: *const c_char) {
    // SAFETY: the environment is NULL, where a library has lost it, or the log of an instance, which lives as long.
    let Some(log) = (unsafe { environment.cast::<Log>().as_ref() }) else {
        return;
    };
    // SAFETY: logger.c ends it with NUL.
    let message = unsafe { CStr::from_ptr(message) }.to_string_lossy();
    log.hear(status, message.trim());
}

/// What an instance logs. A message of an error is kept for the call that fails; a warning is passed on.
struct Log {
    name: String,
    heard: Mutex<Heard>,
}

#[derive(Default)]
struct Heard {
    reason: Option<String>,
    passed_on: u32,
}

impl Log {
    fn hear(&self, status: Status, message: &str) {
        let message: String = message.chars().take(LENGTH).collect();
        match status {
            WARNING => self.pass_on(&message),
            2.. => self.heard.lock().unwrap_or_else(|broken| broken.into_inner()).reason = Some(message),
            _ => log::debug!("{}: {message}", self.name),
        }
    }

    fn pass_on(&self, message: &str) {
        let mut heard = self.heard.lock().unwrap_or_else(|broken| broken.into_inner());
        heard.passed_on += 1;
        match heard.passed_on {
            ..MESSAGES => log::warn!("{}: {message}", self.name),
            MESSAGES => log::warn!("{}: {message}; its further messages are not shown", self.name),
            _ => {}
        }
    }

    /// The message of the last error, without the name of the C function before it.
    fn reason(&self) -> Option<String> {
        let reason = self
            .heard
            .lock()
            .unwrap_or_else(|broken| broken.into_inner())
            .reason
            .take()?;
        let function = reason.split_once(": ").filter(|(name, _)| name.starts_with("fmi2"));
        Some(function.map_or(reason.clone(), |(_, text)| text.into()))
    }
}

/// Declares the functions. One that a library lacks is an error when it is called.
macro_rules! functions {
    ($($name:ident($($argument:ident: $type:ty),*) -> $answer:ty;)*) => {
        #[allow(non_snake_case)]
        struct Functions {
            $($name: Option<unsafe extern "C" fn($($type),*) -> $answer>,)*
        }

        impl Functions {
            unsafe fn of(library: &Library) -> Self {
                // SAFETY: passed on; the instance keeps the library.
                unsafe { Self { $($name: library.get(stringify!($name).as_bytes()).ok().map(|found| *found),)* } }
            }
        }
    };
}

functions! {
    fmi2Instantiate(
        name: *const c_char, kind: c_int, guid: *const c_char, resources: *const c_char, callbacks: *const Callbacks,
        visible: c_int, logging: c_int
    ) -> Component;
    fmi2FreeInstance(c: Component) -> ();
    fmi2SetupExperiment(
        c: Component, has_tolerance: c_int, tolerance: f64, start: f64, has_stop: c_int, stop: f64
    ) -> Status;
    fmi2EnterInitializationMode(c: Component) -> Status;
    fmi2ExitInitializationMode(c: Component) -> Status;
    fmi2Terminate(c: Component) -> Status;
    fmi2GetReal(c: Component, references: *const c_uint, count: usize, values: *mut f64) -> Status;
    fmi2GetInteger(c: Component, references: *const c_uint, count: usize, values: *mut c_int) -> Status;
    fmi2GetBoolean(c: Component, references: *const c_uint, count: usize, values: *mut c_int) -> Status;
    fmi2SetReal(c: Component, references: *const c_uint, count: usize, values: *const f64) -> Status;
    fmi2SetInteger(c: Component, references: *const c_uint, count: usize, values: *const c_int) -> Status;
    fmi2SetBoolean(c: Component, references: *const c_uint, count: usize, values: *const c_int) -> Status;
    fmi2DoStep(c: Component, time: f64, step: f64, keeps_no_state: c_int) -> Status;
}

/// A co-simulation instance in its library.
pub(crate) struct Instance {
    component: Component,
    functions: Functions,
    /// It has been initialised, and no call has failed since.
    runs: bool,
    log: Box<Log>,
    _callbacks: Box<Callbacks>,
    // Unloaded last but for the working folder, which is restored then.
    _library: Library,
    working_folder: WorkingFolder,
}

// SAFETY: an instance is not bound to a thread: FMI 2.0 (section 2.1) asks only that no two of its functions run at the same time, and all calls
// here need `&mut self`. The pointers lead to memory of the instance or of the fields beside them.
unsafe impl Send for Instance {}

/// Calls a function of the instance: `Err` has the reason, as the end of a sentence.
macro_rules! call {
    ($instance:expr, $name:ident($($argument:expr),*)) => {{
        let instance: &mut Instance = $instance;
        match instance.functions.$name {
            // SAFETY: by the contract of this module; the arrays have one element, as their count says.
            Some(function) => {
                let status = unsafe { function(instance.component $(, $argument)*) };
                instance.judged(status)
            }
            None => Err(format!("its library has no function {}", stringify!($name))),
        }
    }};
}

impl Instance {
    /// Loads the library of an FMU, and makes an instance with logging on; `name` is its name there.
    ///
    /// # Errors
    /// The reason, as the end of a sentence.
    pub fn new(fmu: &Unpacked, name: &str, file: &str) -> Result<Self, String> {
        let interface = fmu.description.co_simulation.as_ref();
        let interface = interface.ok_or("it is for model exchange only; export it for co-simulation")?;
        let path = fmu.library(&interface.model_identifier)?;
        let working_folder = WorkingFolder::new();
        // SAFETY: as the contract of this module.
        let library = unsafe { Library::new(&path) }.map_err(|error| unloadable(&error, fmu))?;
        // SAFETY: the contract of this module: the functions have the types of FMI 2.0.
        let functions = unsafe { Functions::of(&library) };
        let log = Box::new(Log { name: file.into(), heard: Mutex::default() });
        let callbacks = Box::new(Callbacks {
            logger: vines_fmu_logger,
            allocate_memory: calloc,
            free_memory: free,
            step_finished: None,
            environment: &raw const *log,
        });
        let text = |text: &str| CString::new(text).map_err(|_| format!("{text:?} contains NUL"));
        let (name, guid) = (text(name)?, text(&fmu.description.guid)?);
        let resources = text(&address(&fmu.resources()))?;
        let instantiate = functions
            .fmi2Instantiate
            .ok_or("its library has no function fmi2Instantiate")?;
        // SAFETY: the contract of this module. The texts and the callbacks live longer than the call and the instance.
        let component = unsafe {
            instantiate(
                name.as_ptr(),
                1,
                guid.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                0,
                1,
            )
        };
        if component.is_null() {
            let tool = match interface.needs_execution_tool {
                true => format!(
                    "; it needs the program that made it ({})",
                    fmu.description.generation_tool
                ),
                false => String::new(),
            };
            let reason = log
                .reason()
                .unwrap_or("fmi2Instantiate returned NULL without a message".into());
            return Err(format!("it makes no instance: {reason}{tool}"));
        }
        working_folder.restore();
        Ok(Self {
            component,
            functions,
            runs: false,
            log,
            _callbacks: callbacks,
            _library: library,
            working_folder,
        })
    }

    /// Initialises it at time 0.
    pub fn start(&mut self) -> Result<(), String> {
        call!(self, fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0))?;
        call!(self, fmi2EnterInitializationMode())?;
        call!(self, fmi2ExitInitializationMode())?;
        self.working_folder.restore();
        self.runs = true;
        Ok(())
    }

    /// A step.
    pub fn step(&mut self, time: f64, step: f64) -> Result<(), String> {
        call!(self, fmi2DoStep(time, step, 1))
    }

    /// The value of a variable; of a Boolean one 0 or 1.
    pub fn get(&mut self, kind: FmiType, reference: c_uint) -> Result<f64, String> {
        let (mut real, mut whole) = (0.0, 0);
        match kind {
            FmiType::Real => call!(self, fmi2GetReal(&reference, 1, &mut real))?,
            FmiType::Boolean => call!(self, fmi2GetBoolean(&reference, 1, &mut whole))?,
            _ => call!(self, fmi2GetInteger(&reference, 1, &mut whole))?,
        }
        Ok(match kind {
            FmiType::Real => real,
            FmiType::Boolean => f64::from(u8::from(whole != 0)),
            _ => whole.into(),
        })
    }

    /// Sets a variable; a Boolean one to whether the value is not 0.
    pub fn set(&mut self, kind: FmiType, reference: c_uint, value: f64) -> Result<(), String> {
        match kind {
            FmiType::Real => call!(self, fmi2SetReal(&reference, 1, &value)),
            FmiType::Boolean => call!(self, fmi2SetBoolean(&reference, 1, &c_int::from(value != 0.0))),
            _ => call!(self, fmi2SetInteger(&reference, 1, &(value.round() as i32))),
        }
    }

    /// What a status means. A message of an error that did not fail is passed on as a warning.
    fn judged(&mut self, status: Status) -> Result<(), String> {
        if let 0 | WARNING = status {
            if let Some(reason) = self.log.reason() {
                self.log.pass_on(&reason);
            }
            return Ok(());
        }
        self.runs = false;
        let returned = match status {
            2 => "fmi2Discard".into(),
            3 => "fmi2Error".into(),
            4 => "fmi2Fatal".into(),
            5 => "fmi2Pending: it steps asynchronously, which the bench does not wait for".into(),
            other => format!("the status {other}, which FMI does not have"),
        };
        Err(self
            .log
            .reason()
            .unwrap_or(format!("it returned {returned}, without a message")))
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.runs {
            let _ = call!(self, fmi2Terminate());
        }
        if let Some(free_instance) = self.functions.fmi2FreeInstance {
            // SAFETY: as the contract of this module; nobody uses the instance afterwards.
            unsafe { free_instance(self.component) };
        }
        self.component = ptr::null_mut();
    }
}

/// Why a library cannot be loaded, as the end of a sentence.
fn unloadable(error: &libloading::Error, fmu: &Unpacked) -> String {
    let folder = format!("{}/", fmu.folder().display());
    format!("its library cannot be loaded: {}", loader(error).replace(&folder, ""))
}

/// What the system's loader says.
fn loader(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or(error.to_string(), ToString::to_string)
}

/// The address `file:///…` of a folder.
fn address(folder: &Path) -> String {
    let path = folder.to_string_lossy().replace('\\', "/");
    let plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"/-_.~:".contains(byte);
    let encoded = path.bytes().map(|byte| match plain(&byte) {
        true => char::from(byte).to_string(),
        false => format!("%{byte:02X}"),
    });
    let root = if path.starts_with('/') { "" } else { "/" };
    format!("file://{root}{}", encoded.collect::<String>())
}

/// Loads a library, and looks for the function that makes instances.
///
/// # Errors
/// What the system's loader says.
pub fn check(path: &Path) -> Result<(), String> {
    // The loader looks for a bare name elsewhere.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    // SAFETY: a library of FMI 2.0 runs nothing of its own when it is loaded.
    let library = unsafe { Library::new(path) }.map_err(|error| loader(&error))?;
    // SAFETY: the function is not called.
    let function = unsafe { library.get::<unsafe extern "C" fn()>(b"fmi2Instantiate") };
    function.map(drop).map_err(|error| loader(&error))
}
