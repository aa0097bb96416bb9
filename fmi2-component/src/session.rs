//! The part of an instance that is an FMU state (FMI 2.0, clause 2.1.8): what can be taken, set back and serialised.
//!
//! The master's handle of a state is a number that looks like a pointer. It is looked up, never followed, so that a handle
//! that was freed, made up, or taken from another instance is refused. What a master forgets to free ends with the instance.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::archive::Archive;
use crate::component::Component;
use crate::life_cycle::{Interface, State};
use crate::model::{Key, Model};
use crate::refusal::Refusal;

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
        self.state = State::ALL
            .into_iter()
            .find(|&s| s as u8 == state)
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
pub(crate) fn serialise<C: Component>(session: &Session<C>) -> Result<Vec<u8>, Refusal> {
    let mut bytes = vec![0; HEADER];
    let mut archive = Archive::writer(&mut bytes);
    archive.whole(&mut identity::<C>())?;
    session.clone().archive(&mut archive)?;
    let checksum = fnv1a(&bytes[HEADER..]);
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..HEADER].copy_from_slice(&checksum.to_le_bytes());
    Ok(bytes)
}

/// The session that `bytes` hold; refuses anything that [`serialise`] of the same model has not written.
pub(crate) fn deserialise<C: Component>(bytes: &[u8], select: Select<C>) -> Result<Session<C>, Refusal> {
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
    let mut found = Identity::default();
    archive.whole(&mut found)?;
    let expected = identity::<C>();
    if found != expected {
        return Err(Refusal::error(format!(
            "the serialised state is of another model: its GUID and version are {} and {}, expected {} and {}",
            found.0, found.1, expected.0, expected.1
        )));
    }
    let mut session = Session::new(select)?;
    session.archive(&mut archive)?;
    archive.finish()?;
    Ok(session)
}

/// GUID and version of a model: together they fix what the bytes mean.
type Identity = (String, String);

fn identity<C: Component>() -> Identity {
    (C::Model::GUID.to_owned(), C::Model::VERSION.to_owned())
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
