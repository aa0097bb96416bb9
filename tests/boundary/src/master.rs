//! The master of `vines-fmu`, which keeps what the instance logs and panics where a call is refused that should not be.

use std::ffi::{CStr, CString, c_int};
use std::ops::Deref;
use std::ptr::{null, null_mut};
use std::sync::{Arc, Mutex};

use fmi2_component::Status;
use vines_fmu::{Answer, Interface, Line};

use crate::library::Fmu;

/// An instance and its log.
#[derive(Debug)]
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
    /// An instance with debug logging off.
    #[must_use]
    pub fn new(fmu: &Fmu, interface: Interface) -> Self {
        Self::at(fmu, interface as c_int, &fmu.guid(), None)
    }

    /// An instance, or the refusal of one, of that type, GUID and resource location.
    ///
    /// # Panics
    /// If the GUID has a NUL inside.
    #[must_use]
    pub fn at(fmu: &Fmu, kind: c_int, guid: &str, location: Option<&CStr>) -> Self {
        let lines = Arc::<Mutex<Vec<Line>>>::default();
        let heard = Arc::clone(&lines);
        let hear = Box::new(move |line: Line| {
            assert!(!line.category.is_empty());
            heard.lock().unwrap().push(line);
        });
        let (guid, location) = (CString::new(guid).unwrap(), location.map_or(null(), CStr::as_ptr));
        // SAFETY: the library is never unloaded.
        let master = unsafe {
            vines_fmu::Master::new(
                fmu.functions,
                c"rig".as_ptr(),
                kind,
                guid.as_ptr(),
                location,
                false,
                hear,
            )
        };
        Self { master, lines }
    }

    /// A co-simulation instance that is ready to step.
    ///
    /// # Panics
    /// If a call is refused.
    #[must_use]
    pub fn ready(fmu: &Fmu) -> Self {
        let master = Self::new(fmu, Interface::CoSimulation);
        master.start();
        master
    }

    /// Takes the instance from its instantiation through initialisation.
    ///
    /// # Panics
    /// If a call is refused.
    pub fn start(&self) {
        self.well(self.master.start());
    }

    /// Switches on these categories of the log and no other.
    ///
    /// # Panics
    /// If the call is refused.
    pub fn listen(&self, categories: &[&CStr]) {
        let names: Vec<_> = categories.iter().map(|name| name.as_ptr()).collect();
        // SAFETY: the instance is alive, and the names outlive the call.
        self.well(unsafe { (self.f.fmi2SetDebugLogging)(self.c, 1, names.len(), names.as_ptr()) });
    }

    /// Asserts that a call was done.
    ///
    /// # Panics
    /// If it was not.
    #[track_caller]
    pub fn well(&self, answer: Answer) {
        assert_eq!(answer, Status::Ok, "{:?}", self.heard());
    }

    /// What was logged since the last call.
    #[must_use]
    pub fn heard(&self) -> Vec<Line> {
        std::mem::take(&mut self.lines.lock().unwrap())
    }

    /// The value of a real variable.
    ///
    /// # Panics
    /// If it cannot be read.
    #[must_use]
    pub fn real(&self, vr: u32) -> f64 {
        let [value] = self.reals(&[vr]);
        value
    }

    /// The plant's count of impacts.
    ///
    /// # Panics
    /// If it cannot be read.
    #[must_use]
    pub fn impacts(&self) -> i32 {
        let mut value = [-1];
        self.well(self.get_integers(&[18], &mut value));
        value[0]
    }

    /// Sets a real variable.
    #[must_use]
    pub fn set_real(&self, vr: u32, value: f64) -> Answer {
        self.set_reals(&[vr], &[value])
    }

    /// Several real variables in one call.
    ///
    /// # Panics
    /// If one cannot be read.
    #[must_use]
    pub fn reals<const N: usize>(&self, vrs: &[u32; N]) -> [f64; N] {
        let mut values = [f64::NAN; N];
        self.well(self.get_reals(vrs, &mut values));
        values
    }

    /// The whole state as bytes, for comparison.
    ///
    /// # Panics
    /// If it cannot be written out.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        let f = &self.f;
        // SAFETY: as the standard asks.
        unsafe {
            self.well((f.fmi2GetFMUstate)(self.c, &mut state));
            self.well((f.fmi2SerializedFMUstateSize)(self.c, state, &mut size));
            let mut bytes = vec![0; size];
            self.well((f.fmi2SerializeFMUstate)(self.c, state, bytes.as_mut_ptr(), size));
            self.well((f.fmi2FreeFMUstate)(self.c, &mut state));
            bytes
        }
    }
}
