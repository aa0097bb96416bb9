//! One call of any function, with random arguments: most of them valid, so that sequences get somewhere.

mod arguments;
mod life;
mod time;
mod values;

use std::ptr::null_mut;

use fmi2_component::Status;

use super::RandomSource;
use crate::functions::Raw;
use crate::master::{Interface, Master};
use arguments::MOST;

/// What a master has in its hands.
pub(super) struct Caller<'a> {
    master: &'a Master,
    states: [Raw; 3],
    blob: Vec<u8>,
    time: f64,
    /// Value references by type.
    known: [Vec<u32>; 3],
    /// How far set-up has come: what would be in order next.
    stage: usize,
    interface: Interface,
}

/// The types whose variables the descriptions have.
const TYPES: [&str; 3] = ["<Real", "<Integer", "<Boolean"];

/// The references of all variables of a type, and one that is unknown.
fn known(description: &str, kind: &str) -> Vec<u32> {
    let variables = description.split("<ScalarVariable").skip(1);
    let reference = |text: &str| {
        let (_, rest) = text.split_once("valueReference=\"")?;
        rest.split('"').next()?.parse().ok()
    };
    let of_kind = variables.filter(|text| text.contains(kind));
    of_kind.filter_map(reference).chain([u32::MAX]).collect()
}

impl<'a> Caller<'a> {
    pub fn new(master: &'a Master, description: &str, interface: Interface) -> Self {
        Self {
            master,
            states: [null_mut(); 3],
            blob: Vec::new(),
            time: 0.0,
            known: TYPES.map(|kind| known(description, kind)),
            stage: 0,
            interface,
        }
    }

    /// Makes a call; answers which, and its status.
    pub fn call(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        // Now and then the other interface's.
        let exchange = (self.interface == Interface::ModelExchange) != random.one_in(12);
        match random.below(16) {
            0..=3 => self.values(random),
            4 => self.states(random),
            5..=6 => self.derivatives(random),
            7 => self.status(random),
            8..=10 => self.life(random),
            _ if exchange => self.exchange(random),
            _ => self.step(random),
        }
    }

    fn references(&self, random: &mut RandomSource, kind: usize) -> [u32; MOST] {
        // Now and then of another type.
        let kind = if random.one_in(12) { random.below(3) } else { kind };
        std::array::from_fn(|_| self.known[kind][random.below(self.known[kind].len())])
    }
}
