//! FMU states: taken, set back, freed, and as bytes (FMI 2.0, clause 2.1.8).

use std::ffi::c_char;

use super::entry::enter;
use super::pointers::{input, output, place};
use super::types::{CComponent, CFmuState};
use crate::component::Component;
use crate::instance::Instance;
use crate::life_cycle::Function::FMUstate;
use crate::refusal::{Refusal, Status};
use crate::session::{Session, deserialise, serialise};

/// `fmi2GetFMUstate`. A state given on entry is overwritten.
pub unsafe fn get_fmu_state<C: Component>(component: CComponent, state: *mut CFmuState) -> Status {
    let body = |instance: &mut Instance<C>| {
        let session = instance.session.clone();
        // SAFETY: the contract is passed on.
        unsafe { keep(instance, state, session) }
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, FMUstate, "fmi2GetFMUstate", body) }
}

/// `fmi2SetFMUstate`.
pub unsafe fn set_fmu_state<C: Component>(component: CComponent, state: CFmuState) -> Status {
    let body = |instance: &mut Instance<C>| {
        let session = instance.snapshots.get(state.addr())?;
        instance.session.clone_from(session);
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, FMUstate, "fmi2SetFMUstate", body) }
}

/// `fmi2FreeFMUstate`. NULL is fine; a freed state becomes NULL.
pub unsafe fn free_fmu_state<C: Component>(component: CComponent, state: *mut CFmuState) -> Status {
    let body = |instance: &mut Instance<C>| {
        if state.is_null() {
            return Ok(());
        }
        // SAFETY: one readable handle, by contract.
        let handle = unsafe { input(state, 1, "FMUstate") }?[0];
        if !handle.is_null() {
            instance.snapshots.free(handle.addr())?;
            // SAFETY: one writable handle, by contract.
            unsafe { place(state, "FMUstate") }?.write(std::ptr::null_mut());
        }
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, FMUstate, "fmi2FreeFMUstate", body) }
}

/// `fmi2SerializedFMUstateSize`.
pub unsafe fn serialized_fmu_state_size<C: Component>(
    component: CComponent,
    state: CFmuState,
    size: *mut usize,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        let bytes = serialise(instance.snapshots.get(state.addr())?)?;
        // SAFETY: one writable place, by contract.
        unsafe { place(size, "size") }?.write(bytes.len());
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, FMUstate, "fmi2SerializedFMUstateSize", body) }
}

/// `fmi2SerializeFMUstate`.
pub unsafe fn serialize_fmu_state<C: Component>(
    component: CComponent,
    state: CFmuState,
    bytes: *mut c_char,
    size: usize,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        let serialised = serialise(instance.snapshots.get(state.addr())?)?;
        if size < serialised.len() {
            return Err(Refusal::error(format!(
                "size = {size} is too small; the serialised state needs {} bytes",
                serialised.len()
            )));
        }
        // SAFETY: the array has `size` bytes by contract, and no fewer than are written.
        let places = unsafe { output(bytes.cast::<u8>(), serialised.len(), "serializedState") }?;
        places.write_copy_of_slice(&serialised);
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, FMUstate, "fmi2SerializeFMUstate", body) }
}

/// `fmi2DeSerializeFMUstate`.
pub unsafe fn deserialize_fmu_state<C: Component>(
    component: CComponent,
    bytes: *const c_char,
    size: usize,
    state: *mut CFmuState,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the array has `size` bytes by contract.
        let bytes = unsafe { input(bytes.cast::<u8>(), size, "serializedState") }?;
        // SAFETY: the contract is passed on.
        unsafe { keep(instance, state, deserialise(bytes, instance.select)?) }
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, FMUstate, "fmi2DeSerializeFMUstate", body) }
}

/// Keeps `session` as the state that `*state` names, or as a new one where that is NULL.
unsafe fn keep<C: Component>(
    instance: &mut Instance<C>,
    state: *mut CFmuState,
    session: Session<C>,
) -> Result<(), Refusal> {
    // SAFETY: one readable handle, by contract.
    let handle = unsafe { input(state, 1, "FMUstate") }?[0];
    let handle = instance.snapshots.put(handle.addr(), session)?;
    // SAFETY: one writable handle, by contract.
    unsafe { place(state, "FMUstate") }?.write(std::ptr::without_provenance_mut(handle));
    Ok(())
}
