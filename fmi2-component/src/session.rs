//! The part of an instance that is an FMU state: what can be taken, set back and serialised.

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
