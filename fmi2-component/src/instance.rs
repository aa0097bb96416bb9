//! An instance in safe Rust: what each call does after its pointers have been checked, and the part of it that is an FMU state
//! (FMI 2.0, clause 2.1.8).
//!
//! The master's handle of a state is a number that looks like a pointer. It is looked up, never followed, so that a handle
//! that was freed, made up, or taken from another instance is refused. A state that a master forgets to free ends with the instance.

use std::collections::HashMap;
use std::ffi::CString;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::archive::Archive;
use crate::component::{Component, Key, Model, RealOf};
use crate::life_cycle::{Interface, State};
use crate::log::Log;
use crate::refusal::{Refusal, Status};
use crate::variable::{Variable, word};

/// How far, relatively, a master's clock may be from ours, and a step may lead past the stop time: both round.
const CLOCK_TOLERANCE: f64 = 1e-9;

/// A component, its log and its FMU states.
pub(crate) struct Instance<C> {
    pub session: Session<C>,
    /// As it was instantiated.
    blank: Session<C>,
    /// Of the model.
    guid: String,
    /// End of the experiment, s. It belongs to the instance, so that a state continues in an experiment that ends later.
    stop_time: f64,
    pub log: Log,
    pub snapshots: Snapshots<C>,
    /// What the last `fmi2GetString` has pointed at.
    pub strings: Vec<CString>,
}

impl<C: Component> Instance<C> {
    pub fn new(log: Log, guid: &str, blank: Session<C>) -> Self {
        Self {
            session: blank.clone(),
            blank,
            guid: guid.to_owned(),
            stop_time: f64::INFINITY,
            log,
            snapshots: Snapshots::new(),
            strings: Vec::new(),
        }
    }

    pub fn set_up(&mut self, tolerance: Option<f64>, start_time: f64, stop_time: Option<f64>) -> Result<(), Refusal> {
        if let Some(tolerance) = tolerance
            && !(0.0..=1.0).contains(&tolerance)
        {
            return Err(Refusal::error(format!(
                "tolerance = {tolerance:e} is refused; allowed is a relative tolerance from 0 to 1"
            )));
        }
        if !start_time.is_finite() {
            return Err(Refusal::error(format!(
                "startTime = {start_time} s is refused; allowed is a finite number"
            )));
        }
        if let Some(stop) = stop_time
            && (stop.is_nan() || stop < start_time)
        {
            return Err(Refusal::error(format!(
                "stopTime = {stop} s is refused; allowed is a number of at least startTime = {start_time} s"
            )));
        }
        self.session.start_time = start_time;
        self.session.time = start_time;
        self.stop_time = stop_time.unwrap_or(f64::INFINITY);
        self.session.stale = true;
        Ok(())
    }

    pub fn leave_initialization(&mut self) -> Result<(), Refusal> {
        self.refresh()?;
        self.session.component.leave_initialization();
        self.session.state = match self.session.interface {
            Interface::CoSimulation => State::StepComplete,
            Interface::ModelExchange => State::EventMode,
        };
        Ok(())
    }

    /// Initialises the component anew, if something was set since it was last.
    pub fn refresh(&mut self) -> Result<(), Refusal> {
        let session = &mut self.session;
        if session.stale {
            session.component.initialise(session.start_time, &self.log)?;
            session.stale = false;
        }
        Ok(())
    }

    pub fn reset(&mut self) {
        self.session.clone_from(&self.blank);
        self.stop_time = f64::INFINITY;
    }

    /// The bytes of an FMU state.
    pub fn serialise(&self, handle: usize) -> Result<Vec<u8>, Refusal> {
        serialise(self.snapshots.get(handle)?, &self.guid)
    }

    /// The FMU state of such bytes.
    pub fn deserialise(&self, bytes: &[u8]) -> Result<Session<C>, Refusal> {
        deserialise(bytes, &self.blank, &self.guid)
    }

    /// The variable, if it may be set now, in a state where setting is legal at all.
    #[inline]
    pub fn check_settable<K: Key>(&self, key: K) -> Result<&'static Variable<K::Value>, Refusal> {
        let variable = key.variable();
        if variable.settable_in(self.session.state) {
            return Ok(variable);
        }
        Err(not_settable(variable, self.session.state))
    }

    /// Announces that values will be set: what was initialised from the old ones is then invalid.
    #[inline]
    pub fn values_change(&mut self) {
        let start = State::InitializationMode as u8;
        self.session.stale |= self.session.state as u8 <= start;
    }

    /// Sets values, all or none: where `set` is refused, the component is what it was before.
    #[cold]
    #[inline(never)]
    pub fn change(&mut self, set: impl FnOnce(&mut C) -> Result<(), Refusal>) -> Result<(), Refusal> {
        let mut changed = self.session.component.clone();
        set(&mut changed)?;
        self.session.component = changed;
        Ok(())
    }

    #[inline]
    pub fn check_finite(key: RealOf<C>, value: f64) -> Result<(), Refusal> {
        if value.is_finite() {
            Ok(())
        } else {
            Err(not_finite(key.variable(), value))
        }
    }

    #[inline]
    pub fn do_step(&mut self, time: f64, step: f64) -> Result<(), Refusal> {
        self.check_step(time, step)?;
        let session = &mut self.session;
        // A step of length zero has nothing to do; some masters make one to update their own bookkeeping.
        if step > 0.0
            && let Err(refusal) = session.component.step(time, step, &self.log)
        {
            session.state = match refusal.status() {
                Status::Discard => State::StepFailed,
                _ => State::Error,
            };
            return Err(refusal);
        }
        session.time = time + step;
        Ok(())
    }

    #[inline]
    fn check_step(&self, time: f64, step: f64) -> Result<(), Refusal> {
        let (own, stop_time) = (self.session.time, self.stop_time);
        let end = time + step;
        let in_order = time == own && end <= stop_time || nearly_in_order((time, step), own, stop_time);
        // NaN compares false, and an infinite step makes an infinite end.
        let sane = step >= 0.0 && end <= f64::MAX;
        if !(sane && in_order) {
            return Err(out_of_order((time, step), own, stop_time));
        }
        self.session.component.accept_step(step)
    }
}

/// Whether a step begins where the last one has ended, and ends at the stop time or before, but for the rounding of the master's clock.
#[inline(never)]
fn nearly_in_order((time, step): (f64, f64), own: f64, stop_time: f64) -> bool {
    let tolerance = CLOCK_TOLERANCE * own.abs().max(step);
    let end = time + step;
    (time - own).abs() <= tolerance && end - stop_time <= tolerance + CLOCK_TOLERANCE * end.abs()
}

/// Why a step cannot be made.
#[cold]
fn out_of_order((time, step): (f64, f64), own: f64, stop_time: f64) -> Refusal {
    let tolerance = CLOCK_TOLERANCE * own.abs().max(step);
    Refusal::error(if !(0.0..=f64::MAX).contains(&step) {
        format!("communicationStepSize = {step} s is refused; allowed is a finite number of at least 0")
    } else if (time - own).abs() <= tolerance {
        format!(
            "a step from {time} s to {} s is refused; the experiment was set up to end at stopTime = {stop_time} s",
            time + step
        )
    } else {
        format!("currentCommunicationPoint = {time} s is refused; the last step has ended at {own} s")
    })
}

#[cold]
fn not_finite(variable: &Variable<f64>, value: f64) -> Refusal {
    variable.refuse(value, "a finite number")
}

#[cold]
fn not_settable<T>(variable: &Variable<T>, state: State) -> Refusal {
    let initial = match variable.initial {
        Some(initial) => format!(", initial {}", word(initial)),
        None => String::new(),
    };
    Refusal::error(format!(
        "{} cannot be set in state {}: it has causality {}, variability {}{initial}",
        variable.name,
        state.name(),
        word(variable.causality),
        word(variable.variability),
    ))
}

/// Selects model exchange in a component; present in instances for model exchange.
pub(crate) type Select<C> = Option<fn(&mut C)>;

/// A component and where it is in its life.
#[derive(Clone, Debug)]
pub(crate) struct Session<C> {
    pub component: C,
    pub interface: Interface,
    pub state: State,
    /// Something was set since the component was last initialised.
    pub stale: bool,
    pub start_time: f64,
    /// Where the last step has led, or what the master has set.
    pub time: f64,
}

impl<C: Component> Session<C> {
    /// A component at its start values.
    ///
    /// # Errors
    /// The component refuses a start value of its own description.
    pub fn new(select: Select<C>) -> Result<Self, Refusal> {
        let mut component = C::new();
        let interface = match select {
            Some(select) => {
                select(&mut component);
                Interface::ModelExchange
            }
            None => Interface::CoSimulation,
        };
        for (key, start) in starts::<<C::Model as Model>::Real>() {
            component.set_real(key, *start)?;
        }
        for (key, start) in starts::<<C::Model as Model>::Integer>() {
            component.set_integer(key, *start)?;
        }
        for (key, start) in starts::<<C::Model as Model>::Boolean>() {
            component.set_boolean(key, *start)?;
        }
        for (key, start) in starts::<<C::Model as Model>::String>() {
            component.set_string(key, start)?;
        }
        Ok(Self {
            component,
            interface,
            state: State::Instantiated,
            stale: true,
            start_time: 0.0,
            time: 0.0,
        })
    }

    /// Writes or reads all of it.
    pub fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        let mut interface = self.interface as u8;
        archive.whole(&mut interface)?;
        if interface != self.interface as u8 {
            return Err(Refusal::error(format!(
                "the serialised state is of the other interface; this instance is for {}",
                self.interface.name()
            )));
        }
        let mut state = self.state as u8;
        archive.whole(&mut state)?;
        self.state = *State::ALL
            .get(usize::from(state))
            .ok_or_else(|| Refusal::error(format!("{state} is no state of the life cycle")))?;
        archive.whole(&mut self.stale)?;
        for time in [&mut self.start_time, &mut self.time] {
            archive.whole(time)?;
        }
        self.component.archive(archive)
    }
}

/// The variables that a master may set at the start, with their start values.
fn starts<K: Key>() -> impl Iterator<Item = (K, &'static K::Value)> {
    K::ALL.iter().filter_map(|&key| {
        let variable = key.variable();
        let start = variable.start.as_ref()?;
        variable.settable_at_start(false).then_some((key, start))
    })
}

/// Changes with the layout that the shell itself writes.
const MAGIC: [u8; 8] = *b"FMU2 st3";
/// Magic, checksum.
const HEADER: usize = 16;

/// The session as bytes.
fn serialise<C: Component>(session: &Session<C>, guid: &str) -> Result<Vec<u8>, Refusal> {
    let mut bytes = vec![0; HEADER];
    let mut archive = Archive::writer(&mut bytes);
    archive.whole(&mut identity::<C>(guid))?;
    session.clone().archive(&mut archive)?;
    let checksum = fnv1a(&bytes[HEADER..]);
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..HEADER].copy_from_slice(&checksum.to_le_bytes());
    Ok(bytes)
}

/// The session that `bytes` hold; refuses anything that [`serialise`] of the same model has not written.
fn deserialise<C: Component>(bytes: &[u8], blank: &Session<C>, guid: &str) -> Result<Session<C>, Refusal> {
    let Some((header, body)) = bytes.split_at_checked(HEADER) else {
        return Err(Refusal::error(format!(
            "the serialised state has {} bytes; expected more than {HEADER}",
            bytes.len()
        )));
    };
    if header[..8] != MAGIC {
        return Err(Refusal::error(
            "the bytes are not a serialised state of this component, or one of another version",
        ));
    }
    if header[8..] != fnv1a(body).to_le_bytes() {
        return Err(Refusal::error(
            "the serialised state is truncated or damaged: its checksum differs",
        ));
    }
    let mut archive = Archive::reader(body);
    let mut written = Identity::default();
    archive.whole(&mut written)?;
    let expected = identity::<C>(guid);
    if written != expected {
        return Err(Refusal::error(format!(
            "the serialised state is of another model: its GUID and version are {} and {}, expected {} and {}",
            written.0, written.1, expected.0, expected.1
        )));
    }
    let mut session = blank.clone();
    session.archive(&mut archive)?;
    archive.finish()?;
    Ok(session)
}

/// GUID and version of a model: together they fix what the bytes mean.
type Identity = (String, String);

fn identity<C: Component>(guid: &str) -> Identity {
    (guid.to_owned(), C::Model::VERSION.to_owned())
}

/// The 64-bit Fowler–Noll–Vo hash, variant 1a.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Unique in the process, so that no instance mistakes another's handle for its own.
static NEXT: AtomicUsize = AtomicUsize::new(1);

/// The FMU states of one instance.
#[derive(Debug)]
pub(crate) struct Snapshots<C>(HashMap<usize, Session<C>>);

impl<C: Clone> Snapshots<C> {
    pub fn new() -> Self {
        Self(HashMap::new())
    }

    /// Keeps `session` under `handle`, or under a new one where that is 0; answers which.
    pub fn put(&mut self, handle: usize, session: Session<C>) -> Result<usize, Refusal> {
        if handle == 0 {
            let handle = NEXT.fetch_add(1, Ordering::Relaxed);
            self.0.insert(handle, session);
            return Ok(handle);
        }
        *self.0.get_mut(&handle).ok_or_else(unknown)? = session;
        Ok(handle)
    }

    pub fn get(&self, handle: usize) -> Result<&Session<C>, Refusal> {
        self.0.get(&handle).ok_or_else(unknown)
    }

    pub fn free(&mut self, handle: usize) -> Result<(), Refusal> {
        self.0.remove(&handle).map(drop).ok_or_else(unknown)
    }
}

fn unknown() -> Refusal {
    Refusal::error(
        "the FMU state is not one that this instance has given out, or it has been freed; expected one from \
         fmi2GetFMUstate or fmi2DeSerializeFMUstate of the same instance",
    )
}
