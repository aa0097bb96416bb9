//! FMUs as a master sees them: shared libraries, called through C pointers with good and with bad arguments.
//!
//! This is a crate of its own because all libraries export the same names: they can be loaded into one program, but
//! not linked into one. The master keeps what its logger hears, and does nothing that it is not told to; a master that simulates is in
//! `rigs/fmu`.

#![allow(clippy::macro_metavars_in_unsafe)] // `call!` is for tests, whose calls are all unsafe

mod functions;
pub mod fuzz;
pub mod pair;

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::ptr::{null, null_mut};

use fmi2_component::abi::{self, CComponent, CallbackFunctions};
use fmi2_component::{Logger, Status};
use fmi2_description::Description;
pub use functions::Functions;
use libloading::Library;

/// Model identifiers, and the names that cargo gives their libraries. `Tank` is the example of the shell.
const MODELS: [[&str; 2]; 3] = [
    ["LoViNes", "lovines_fmu"],
    ["PhaseLock", "phase_lock_fmu"],
    ["Tank", "fmi2_example_tank"],
];
/// Their descriptions.
const DESCRIPTIONS: [&str; 3] = [
    include_str!("../../../modelDescription.xml"),
    include_str!("../../../controller/modelDescription.xml"),
    include_str!("../../../fmi2-component/example/modelDescription.xml"),
];

/// A loaded library. It is never unloaded, so that its functions can be copied.
#[derive(Clone, Copy, Debug)]
pub struct Fmu {
    /// `modelIdentifier`.
    pub name: &'static str,
    /// The library's functions.
    pub functions: Functions,
    /// `modelDescription.xml`.
    pub description: &'static str,
}

impl Fmu {
    /// `LoViNes`, built as this program is.
    pub fn plant() -> Self {
        Self::load(0, &Self::path("LoViNes"))
    }

    /// `PhaseLock`, built as this program is.
    pub fn controller() -> Self {
        Self::load(1, &Self::path("PhaseLock"))
    }

    /// `Tank`, built as this program is.
    pub fn tank() -> Self {
        Self::load(2, &Self::path("Tank"))
    }

    /// Where cargo puts the library of that name: the folder of this profile's dependencies, for instance `target/debug/deps`.
    pub fn path(name: &str) -> PathBuf {
        let model = MODELS.iter().find(|model| model[0] == name);
        let library = model.expect("one of the models")[1];
        let mut folder = std::env::current_exe().expect("a program knows where it is");
        folder.pop();
        if !folder.ends_with("deps") {
            folder.push("deps");
        }
        folder.join(format!("{DLL_PREFIX}{library}{DLL_SUFFIX}"))
    }

    /// Plant and controller, built as this program is, or as an FMU holds them: `LoViNes` and `PhaseLock` with the platform's suffix, in
    /// one folder.
    pub fn pair(packed: Option<&Path>) -> [Self; 2] {
        let Some(folder) = packed else {
            return [Self::plant(), Self::controller()];
        };
        [0, 1].map(|model| {
            // An absolute path: a loader looks for a bare name elsewhere.
            let path = std::path::absolute(folder.join(format!("{}{DLL_SUFFIX}", MODELS[model][0])));
            Self::load(model, &path.expect("a folder has a path"))
        })
    }

    fn load(model: usize, path: &Path) -> Self {
        let (name, description) = (MODELS[model][0], DESCRIPTIONS[model]);
        // SAFETY: it is ours, and loading it runs no code of its own. It stays loaded, since nobody drops it.
        let functions = unsafe { Library::new(path).and_then(|library| Functions::load(&ManuallyDrop::new(library))) };
        let functions = functions.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Self { name, functions, description }
    }

    /// What the description says.
    pub fn parsed(&self) -> Description {
        Description::parse(self.description).expect("the library was built from it")
    }

    /// The value reference of a variable.
    pub fn reference(&self, name: &str) -> u32 {
        let description = self.parsed();
        let variable = description.variable(name).expect("a variable of that name");
        variable.value_reference
    }

    /// The GUID that the library was built with.
    pub fn guid(&self) -> String {
        fmi2_component_build::guid_of(self.description).expect("the library was built from it")
    }
}

/// `fmi2Type`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// `fmi2ModelExchange`.
    ModelExchange = 0,
    /// `fmi2CoSimulation`.
    CoSimulation = 1,
}

/// A line that the logger has heard.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// How the call ends.
    pub status: Status,
    /// The log category.
    pub category: String,
    /// The text, as a printf format.
    pub text: String,
}

unsafe extern "C" fn hear(
    environment: *mut c_void,
    name: *const c_char,
    status: Status,
    category: *const c_char,
    message: *const c_char,
) {
    assert!(!name.is_null() && !category.is_null() && !message.is_null());
    // SAFETY: none is NULL, and the environment is the list that `callbacks` was given.
    unsafe {
        let text = |pointer| CStr::from_ptr(pointer).to_str().unwrap().to_owned();
        (*environment.cast::<Vec<Line>>()).push(Line { status, category: text(category), text: text(message) });
    }
}

/// Calls a function of an instance: `call!(master.fmi2DoStep(0.0, 0.1, 1))`. The arguments must be as the standard asks: arrays as long
/// as they are said to be, or pointers and counts that the component must refuse.
#[macro_export]
macro_rules! call {
    ($master:ident.$name:ident($($argument:expr),*)) => {
        unsafe { ($master.f.$name)($master.c, $($argument),*) }
    };
}

/// Asserts that a call is an error with one line in the log, which contains all of the texts:
/// `refused!(master.fmi2DoStep(0.0, -0.1, 1) => "at least 0")`.
#[macro_export]
macro_rules! refused {
    ($master:ident.$name:ident($($argument:expr),*) $(=> $($part:expr),*)?) => {
        $master.expect($crate::call!($master.$name($($argument),*)), Status::Error, &[$($($part),*)?])
    };
}

/// Callbacks whose logger appends to `lines`.
pub fn callbacks(lines: *mut Vec<Line>) -> CallbackFunctions {
    let hear: unsafe extern "C" fn(_, _, _, _, _) = hear;
    // SAFETY: a variadic function cannot be written in stable Rust. The named arguments travel alike, and the shell
    // passes no others.
    let logger = unsafe { std::mem::transmute::<*const (), Logger>(hear as *const ()) };
    CallbackFunctions {
        logger: Some(logger),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: lines.cast(),
    }
}

/// An instance and its log.
#[derive(Debug)]
pub struct Master {
    /// The instance; NULL where it was refused.
    pub c: CComponent,
    /// The library's functions.
    pub f: Functions,
    lines: *mut Vec<Line>,
    _callbacks: Box<CallbackFunctions>,
}

// SAFETY: an instance may be called from changing threads, one at a time.
unsafe impl Send for Master {}

impl Master {
    /// An instance with debug logging off.
    pub fn new(fmu: &Fmu, interface: Interface) -> Self {
        let guid = CString::new(fmu.guid()).expect("no NUL in a number");
        let texts = [c"rig".as_ptr(), guid.as_ptr(), null()];
        Self::instantiate(fmu.functions, interface as c_int, texts)
    }

    /// An instance, or the refusal of one, of that `fmi2Type`, and of that name, GUID and resource location: NULL or C strings.
    pub fn instantiate(f: Functions, kind: c_int, [name, guid, location]: [abi::CString; 3]) -> Self {
        let lines: *mut Vec<Line> = Box::into_raw(Box::default());
        let callbacks = Box::new(callbacks(lines));
        // SAFETY: as the standard asks.
        let c = unsafe { (f.fmi2Instantiate)(name, kind, guid, location, &*callbacks, 0, 0) };
        Self { c, f, lines, _callbacks: callbacks }
    }

    /// An instance that is not initialized, with these values set.
    pub fn with(fmu: &Fmu, interface: Interface, values: &[(u32, f64)]) -> Self {
        let master = Self::new(fmu, interface);
        for &(vr, value) in values {
            master.well(master.set_real(vr, value));
        }
        master
    }

    /// An initialized instance, with these values set before: for co-simulation ready to step, for model exchange in Event Mode.
    pub fn started(fmu: &Fmu, interface: Interface, values: &[(u32, f64)]) -> Self {
        let master = Self::with(fmu, interface, values);
        master.start();
        master
    }

    /// A co-simulation instance that is ready to step.
    pub fn ready(fmu: &Fmu) -> Self {
        Self::started(fmu, Interface::CoSimulation, &[])
    }

    /// Takes the instance into Initialization Mode.
    pub fn enter_initialization(&self) {
        self.well(call!(self.fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0)));
        self.well(call!(self.fmi2EnterInitializationMode()));
    }

    /// Takes the instance from its instantiation through initialization.
    pub fn start(&self) {
        self.enter_initialization();
        self.well(call!(self.fmi2ExitInitializationMode()));
    }

    /// Asserts that a call was done.
    #[track_caller]
    pub fn well(&self, status: Status) {
        assert_eq!(status, Status::Ok, "{:?}", self.heard());
    }

    /// Asserts the status of a call, and that one line was logged, which contains all of `parts`.
    #[track_caller]
    pub fn expect(&self, status: Status, expected: Status, parts: &[&str]) {
        let heard = self.heard();
        assert_eq!((status, heard.len()), (expected, 1), "{heard:?}");
        for part in parts {
            assert!(heard[0].text.contains(part), "no {part:?} in {heard:?}");
        }
    }

    /// What was logged since the last call.
    pub fn heard(&self) -> Vec<Line> {
        // SAFETY: the list lives as long as the master, and no call is under way.
        unsafe { std::mem::take(&mut *self.lines) }
    }

    /// The value of a real variable.
    pub fn real(&self, vr: u32) -> f64 {
        let [value] = self.reals(&[vr]);
        value
    }

    /// Several real variables in one call.
    #[track_caller]
    pub fn reals<const N: usize>(&self, vrs: &[u32; N]) -> [f64; N] {
        let mut values = [f64::NAN; N];
        self.well(call!(self.fmi2GetReal(vrs.as_ptr(), N, values.as_mut_ptr())));
        values
    }

    /// The value of an integer or enumeration.
    pub fn integer(&self, vr: u32) -> i32 {
        let mut value = -1;
        self.well(call!(self.fmi2GetInteger(&vr, 1, &mut value)));
        value
    }

    /// The value of a Boolean variable.
    pub fn boolean(&self, vr: u32) -> bool {
        let mut value = -1;
        self.well(call!(self.fmi2GetBoolean(&vr, 1, &mut value)));
        value == 1
    }

    /// The plant's count of impacts.
    pub fn impacts(&self) -> i32 {
        self.integer(18)
    }

    /// Sets a real variable.
    pub fn set_real(&self, vr: u32, value: f64) -> Status {
        self.set_reals(&[vr], &[value])
    }

    /// Sets several real variables in one call.
    pub fn set_reals<const N: usize>(&self, vrs: &[u32; N], values: &[f64; N]) -> Status {
        call!(self.fmi2SetReal(vrs.as_ptr(), N, values.as_ptr()))
    }

    /// Sets an integer or enumeration.
    pub fn set_integer(&self, vr: u32, value: i32) -> Status {
        call!(self.fmi2SetInteger(&vr, 1, &value))
    }

    /// Takes a step.
    pub fn step(&self, time: f64, step: f64) -> Status {
        call!(self.fmi2DoStep(time, step, 1))
    }

    /// The whole state as bytes, for comparison.
    pub fn bytes(&self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        self.well(call!(self.fmi2GetFMUstate(&mut state)));
        self.well(call!(self.fmi2SerializedFMUstateSize(state, &mut size)));
        let mut bytes = vec![0; size];
        let place = bytes.as_mut_ptr().cast();
        self.well(call!(self.fmi2SerializeFMUstate(state, place, size)));
        self.well(call!(self.fmi2FreeFMUstate(&mut state)));
        bytes
    }

    /// Sets the state that these bytes are of; an error if they are of none.
    pub fn restore(&self, bytes: &[u8]) -> Status {
        let mut state = null_mut();
        let status = call!(self.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state));
        assert_eq!(status == Status::Ok, !state.is_null());
        if status == Status::Ok {
            self.well(call!(self.fmi2SetFMUstate(state)));
            self.well(call!(self.fmi2FreeFMUstate(&mut state)));
        }
        status
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        // SAFETY: the list came out of a box, and after the instance nobody writes to it.
        unsafe {
            (self.f.fmi2FreeInstance)(self.c);
            drop(Box::from_raw(self.lines));
        }
    }
}
