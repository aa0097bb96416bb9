//! Random sequences of calls, with valid and invalid arguments: no crash, no hang, and a reason for every error.

mod calls;
mod random;

use std::time::{Duration, Instant};

use fmi2_component::Status;

use crate::library::Fmu;
use crate::master::{Interface, Master};
use calls::Caller;
pub use random::RandomSource;

/// What became of the calls of some sequences.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Sequences.
    pub sequences: u64,
    /// Calls by their status: OK, warning, discard, error, fatal, pending.
    pub statuses: [u64; 6],
    /// Error calls after which the state was compared with that before: none has changed.
    pub harmless: u64,
    /// The longest call.
    pub longest: Duration,
}

impl Tally {
    /// Both together.
    #[must_use]
    pub fn and(mut self, other: &Self) -> Self {
        self.sequences += other.sequences;
        for (sum, more) in self.statuses.iter_mut().zip(other.statuses) {
            *sum += more;
        }
        self.harmless += other.harmless;
        self.longest = self.longest.max(other.longest);
        self
    }

    /// All calls.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.statuses.iter().sum()
    }
}

/// A call that takes longer is told of.
const SLOW: Duration = Duration::from_secs(2);
/// Calls in a sequence.
const CALLS: usize = 80;

/// Makes the sequence of that seed with a new instance.
///
/// # Panics
/// If a call is fatal, or an error without a reason, or an illegal call has changed something.
#[must_use]
pub fn sequence(fmu: &Fmu, seed: u64) -> Tally {
    let mut random = RandomSource::new(seed);
    let interface = if fmu.description.contains("<ModelExchange") && random.one_in(2) {
        Interface::ModelExchange
    } else {
        Interface::CoSimulation
    };
    let master = Master::new(fmu, interface);
    let mut caller = Caller::new(&master, fmu.description, interface);
    let mut tally = Tally { sequences: 1, ..Tally::default() };
    if random.one_in(2) {
        master.start();
    }
    for n in 0..CALLS {
        let before = random.one_in(8).then(|| snapshot(&master)).flatten();
        let _ = master.heard();
        let began = Instant::now();
        let (name, status) = caller.call(&mut random);
        tally.longest = tally.longest.max(began.elapsed());
        if began.elapsed() > SLOW {
            eprintln!(
                "slow: {:?} for {name} ({status:?}) of {}, {interface:?}, seed {seed}, call {n}",
                began.elapsed(),
                fmu.name
            );
        }
        tally.statuses[status as usize] += 1;
        let heard = master.heard();
        let place = || format!("{} {interface:?}, seed {seed}, call {n}: {name}: {heard:?}", fmu.name);
        assert_ne!(status, Status::Fatal, "{}", place());
        if matches!(status, Status::Error | Status::Discard) {
            let reason = heard.iter().find(|line| line.status == status);
            let reason = reason.unwrap_or_else(|| panic!("no reason: {}", place()));
            assert!(reason.text.starts_with(name), "{}", place());
            let illegal = reason.text.contains("is illegal in state");
            if let Some(before) = before.filter(|_| illegal) {
                assert_eq!(snapshot(&master), Some(before), "harm done: {}", place());
                tally.harmless += 1;
            }
        }
    }
    tally
}

fn snapshot(master: &Master) -> Option<Vec<u8>> {
    let bytes = master.bytes();
    let _ = master.heard();
    Some(bytes)
}
