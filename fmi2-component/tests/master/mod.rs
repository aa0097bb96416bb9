//! The master of `vines-fmu` for the component that a test is linked with; it keeps what its logger hears.
#![allow(dead_code)] // each test file uses its own part

use std::ffi::{CString, c_char, c_int, c_uint};
use std::ops::Deref;
use std::ptr::{null, null_mut};
use std::sync::{Arc, Mutex};

use fmi2_component::Status;
use fmi2_component::abi::{CallbackFunctions, EventInfo};
use vines_fmu::Functions;
pub use vines_fmu::{Answer, Line, Raw};

macro_rules! linked {
    ($($name:ident($($argument:ty),*) -> $answer:ty;)*) => {
        unsafe extern "C" {
            $(pub fn $name($(_: $argument),*) -> $answer;)*
        }

        const FUNCTIONS: Functions = Functions { $($name,)* };
    };
}

vines_fmu::fmi2_functions!(linked);

/// An instance and its log.
pub struct Master {
    master: vines_fmu::Master,
    lines: Arc<Mutex<Vec<Line>>>,
}

impl Deref for Master {
    type Target = vines_fmu::Master;

    fn deref(&self) -> &Self::Target {
        &self.master
    }
}

impl Master {
    /// A co-simulation instance with debug logging off.
    pub fn new(guid: &str) -> Self {
        let guid = CString::new(guid).unwrap();
        Self::at(c"one".as_ptr(), 1, guid.as_ptr(), null())
    }

    /// An instance, or the refusal of one, of that name, type, GUID and resource location.
    pub fn at(name: *const c_char, kind: c_int, guid: *const c_char, location: *const c_char) -> Self {
        let lines = Arc::<Mutex<Vec<Line>>>::default();
        let heard = Arc::clone(&lines);
        let hear = Box::new(move |line: Line| {
            assert!(!line.category.is_empty());
            heard.lock().unwrap().push(line);
        });
        // SAFETY: the functions are part of this program, and the texts end with NUL.
        let master = unsafe { vines_fmu::Master::new(FUNCTIONS, name, kind, guid, location, false, hear) };
        Self { master, lines }
    }

    /// An instance that is ready to step.
    pub fn ready(guid: &str) -> Self {
        let master = Self::new(guid);
        assert_eq!(master.start(), Status::Ok);
        master
    }

    /// What was logged since the last call.
    pub fn heard(&self) -> Vec<Line> {
        std::mem::take(&mut self.lines.lock().unwrap())
    }

    /// Asserts that one line was logged which contains all of `parts`.
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

    pub fn real(&self, vr: u32) -> f64 {
        let mut value = [f64::NAN];
        assert_eq!(self.get_reals(&[vr], &mut value), Status::Ok);
        value[0]
    }

    pub fn set_real(&self, vr: u32, value: f64) -> Answer {
        self.set_reals(&[vr], &[value])
    }

    /// The whole state as bytes, for comparison.
    pub fn bytes(&self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        unsafe {
            assert_eq!(fmi2GetFMUstate(self.c, &mut state), Status::Ok);
            assert_eq!(fmi2SerializedFMUstateSize(self.c, state, &mut size), Status::Ok);
            let mut bytes = vec![0; size];
            assert_eq!(
                fmi2SerializeFMUstate(self.c, state, bytes.as_mut_ptr(), size),
                Status::Ok
            );
            assert_eq!(fmi2FreeFMUstate(self.c, &mut state), Status::Ok);
            assert!(state.is_null());
            bytes
        }
    }
}
