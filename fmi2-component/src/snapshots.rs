//! FMU states (FMI 2.0, clause 2.1.8): kept by the instance and known to the master by number.
//!
//! The master's handle is a number that looks like a pointer. It is looked up, never followed, so that a handle that was
//! freed, made up, or taken from another instance is refused. What a master forgets to free ends with the instance.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::refusal::Refusal;
use crate::session::Session;

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
