//! FMUs as a master sees them: shared libraries, called through C pointers with good and with bad arguments.
//!
//! This is a crate of its own because all libraries export the same names: they can be loaded into one program, but
//! not linked into one. The master keeps what its logger hears, and does nothing that it is not told to; a master that simulates is in
//! `lab/fmu`.

#![allow(clippy::macro_metavars_in_unsafe)] // `call!` is for tests, whose calls are all unsafe

mod functions;
pub mod fuzz;
pub mod pair;

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr::{null, null_mut};

use fmi2_component::abi::CallbackFunctions;
use fmi2_component::{Logger, Status};
use fmi2_description::Description;
pub use functions::{Functions, Raw};
use libloading::Library;

/// Description of `LoViNes`, of `PhaseLock`, and of `Tank`, the example of the shell.
const DESCRIPTIONS: [&str; 3] = [
    include_str!("../../../modelDescription.xml"),
    include_str!("../../../controller/fmu/modelDescription.xml"),
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
        Self::load("LoViNes", DESCRIPTIONS[0], &Self::path("LoViNes"))
    }

    /// `PhaseLock`, built as this program is.
    pub fn controller() -> Self {
        Self::load("PhaseLock", DESCRIPTIONS[1], &Self::path("PhaseLock"))
    }

    /// `Tank`, built as this program is.
    pub fn tank() -> Self {
        Self::load("Tank", DESCRIPTIONS[2], &Self::path("Tank"))
    }

    /// Where cargo puts the library of that name: the folder of this profile's dependencies, for instance `target/debug/deps`.
    pub fn path(name: &str) -> PathBuf {
        let library = match name {
            "LoViNes" => "lovines_fmu",
            "Tank" => "fmi2_example_tank",
            _ => "phase_lock_fmu",
        };
        let program = std::env::current_exe().expect("a program knows where it is");
        let folder = program.parent().expect("it is in a folder");
        let folder = if folder.ends_with("deps") {
            folder.to_owned()
        } else {
            folder.join("deps")
        };
        folder.join(format!("{DLL_PREFIX}{library}{DLL_SUFFIX}"))
    }

    /// Both libraries as an FMU holds them, `LoViNes` and `PhaseLock` with the platform's suffix, from one folder.
    pub fn packed(folder: &Path) -> [Self; 2] {
        let load = |name, description| {
            // An absolute path: a loader looks for a bare name elsewhere.
            let path = std::path::absolute(folder.join(format!("{name}{DLL_SUFFIX}")));
            Self::load(name, description, &path.expect("a folder has a path"))
        };
        [load("LoViNes", DESCRIPTIONS[0]), load("PhaseLock", DESCRIPTIONS[1])]
    }

    fn load(name: &'static str, description: &'static str, path: &Path) -> Self {
        // SAFETY: it is ours, and loading it runs no code of its own.
        let library = unsafe { Library::new(path) };
        let library = library.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        // SAFETY: an FMI 2.0 library, which stays loaded since nobody drops it.
        let functions = unsafe { Functions::load(&library) };
        std::mem::forget(library);
        Self {
            name,
            functions: functions.unwrap_or_else(|error| panic!("{}: {error}", path.display())),
            description,
        }
    }

    /// The value reference of a variable.
    pub fn reference(&self, name: &str) -> u32 {
        let description = Description::parse(self.description).expect("the library was built from it");
        let variable = description.variable(name);
        variable
            .unwrap_or_else(|| panic!("{} has no {name}", self.name))
            .value_reference
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
    pub c: Raw,
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
        Self::at(fmu, interface as c_int, &fmu.guid(), None)
    }

    /// An instance, or the refusal of one, of that type, GUID and resource location.
    pub fn at(fmu: &Fmu, kind: c_int, guid: &str, location: Option<&CStr>) -> Self {
        let lines: *mut Vec<Line> = Box::into_raw(Box::default());
        let guid = CString::new(guid).unwrap();
        let functions = Box::new(callbacks(lines));
        let location = location.map_or(null(), CStr::as_ptr);
        let f = fmu.functions;
        // SAFETY: as the standard asks.
        let c = unsafe { (f.fmi2Instantiate)(c"rig".as_ptr(), kind, guid.as_ptr(), location, &*functions, 0, 0) };
        Self { c, f, lines, _callbacks: functions }
    }

    /// A co-simulation instance that is ready to step.
    pub fn ready(fmu: &Fmu) -> Self {
        let master = Self::new(fmu, Interface::CoSimulation);
        master.start();
        master
    }

    /// Takes the instance into Initialization Mode.
    pub fn enter_initialization(&self) {
        // SAFETY: the instance is alive.
        unsafe {
            self.well((self.f.fmi2SetupExperiment)(self.c, 0, 0.0, 0.0, 0, 0.0));
            self.well((self.f.fmi2EnterInitializationMode)(self.c));
        }
    }

    /// Takes the instance from its instantiation through initialization.
    pub fn start(&self) {
        self.enter_initialization();
        // SAFETY: the instance is alive.
        self.well(unsafe { (self.f.fmi2ExitInitializationMode)(self.c) });
    }

    /// Switches on these categories of the log and no other.
    pub fn listen(&self, categories: &[&CStr]) {
        let names: Vec<_> = categories.iter().map(|name| name.as_ptr()).collect();
        // SAFETY: the instance is alive, and the names outlive the call.
        self.well(unsafe { (self.f.fmi2SetDebugLogging)(self.c, 1, names.len(), names.as_ptr()) });
    }

    /// Asserts that a call was done.
    #[track_caller]
    pub fn well(&self, status: Status) {
        assert_eq!(status, Status::Ok, "{:?}", self.heard());
    }

    /// What was logged since the last call.
    pub fn heard(&self) -> Vec<Line> {
        // SAFETY: the list lives as long as the master, and no call is under way.
        unsafe { std::mem::take(&mut *self.lines) }
    }

    /// Asserts that one line was logged, and that it contains all of `parts`.
    #[track_caller]
    pub fn heard_one(&self, parts: &[&str]) {
        let heard = self.heard();
        let [line] = heard.as_slice() else {
            panic!("not one line: {heard:?}")
        };
        for part in parts {
            assert!(line.text.contains(part), "no {part:?} in {line:?}");
        }
    }

    /// The value of a real variable.
    pub fn real(&self, vr: u32) -> f64 {
        let [value] = self.reals(&[vr]);
        value
    }

    /// The value of an integer or enumeration.
    pub fn integer(&self, vr: u32) -> i32 {
        let mut value = -1;
        // SAFETY: one reference, one place.
        self.well(unsafe { (self.f.fmi2GetInteger)(self.c, &vr, 1, &mut value) });
        value
    }

    /// Sets an integer or enumeration.
    pub fn set_integer(&self, vr: u32, value: i32) -> Status {
        // SAFETY: one reference, one value.
        unsafe { (self.f.fmi2SetInteger)(self.c, &vr, 1, &value) }
    }

    /// The plant's count of impacts.
    pub fn impacts(&self) -> i32 {
        self.integer(18)
    }

    /// An instance that is not initialized, with these values set.
    pub fn with(fmu: &Fmu, interface: Interface, values: &[(u32, f64)]) -> Self {
        let master = Self::new(fmu, interface);
        for &(vr, value) in values {
            master.well(master.set_real(vr, value));
        }
        master
    }

    /// Sets a real variable.
    pub fn set_real(&self, vr: u32, value: f64) -> Status {
        self.set_reals(&[vr], &[value])
    }

    /// Several real variables in one call.
    #[track_caller]
    pub fn reals<const N: usize>(&self, vrs: &[u32; N]) -> [f64; N] {
        let mut values = [f64::NAN; N];
        // SAFETY: as many places as references.
        self.well(unsafe { (self.f.fmi2GetReal)(self.c, vrs.as_ptr(), N, values.as_mut_ptr()) });
        values
    }

    /// Sets several real variables in one call.
    pub fn set_reals<const N: usize>(&self, vrs: &[u32; N], values: &[f64; N]) -> Status {
        // SAFETY: as many values as references.
        unsafe { (self.f.fmi2SetReal)(self.c, vrs.as_ptr(), N, values.as_ptr()) }
    }

    /// Takes a step.
    pub fn step(&self, time: f64, step: f64) -> Status {
        // SAFETY: the instance is alive.
        unsafe { (self.f.fmi2DoStep)(self.c, time, step, 1) }
    }

    /// The whole state as bytes, for comparison.
    pub fn bytes(&self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        let f = &self.f;
        // SAFETY: as the standard asks.
        unsafe {
            self.well((f.fmi2GetFMUstate)(self.c, &mut state));
            self.well((f.fmi2SerializedFMUstateSize)(self.c, state, &mut size));
            let mut bytes = vec![0; size];
            self.well((f.fmi2SerializeFMUstate)(
                self.c,
                state,
                bytes.as_mut_ptr().cast(),
                size,
            ));
            self.well((f.fmi2FreeFMUstate)(self.c, &mut state));
            bytes
        }
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
