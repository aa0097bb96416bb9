//! Many independent plants at once: several abreast in the lanes of vector instructions, on all cores.
//!
//! Plants that cross their cavities from wall to wall go abreast ([`crate::plant`]'s loop with masks in place of branches),
//! where the advance is long enough to pay for lining them up; whatever else one meets, it meets alone. The vector instructions are those of the machine it runs on, found out at run
//! time. No fused operation is used, so that a batch gives the same bits whatever the machine and the number of cores; a
//! plant that crosses gets those it would get alone, and others agree to rounding.

use crate::base_motion::Drive;
use crate::plant::abreast::Run;
use crate::plant::{Outcome, Plant};
use pulp::NullaryFnOnce;
use rayon::prelude::*;

/// So many plants go abreast.
pub const WIDTH: usize = 16;
/// Plants that one core takes at a time.
const PORTION: usize = 4 * WIDTH;

/// Many plants, each with a drive of its own.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    members: Vec<Member>,
}

#[derive(Clone, Debug)]
struct Member {
    plant: Plant,
    drive: Drive,
    outcome: Outcome,
}

impl Batch {
    /// A batch of plants and what drives them.
    pub fn new(plants: impl IntoIterator<Item = (Plant, Drive)>) -> Self {
        let members = plants.into_iter().map(|(plant, drive)| Member {
            plant,
            drive,
            outcome: Outcome::default(),
        });
        Self {
            members: members.collect(),
        }
    }

    /// Advances every plant by `duration` seconds (0 or above), on all cores.
    pub fn advance(&mut self, duration: f64) {
        self.members
            .par_chunks_mut(PORTION)
            .for_each(|portion| advance(portion, duration));
    }

    /// As [`Self::advance`], on this core alone.
    pub fn advance_on_one_core(&mut self, duration: f64) {
        advance(&mut self.members, duration);
    }

    /// The plants.
    pub fn plants(&self) -> impl Iterator<Item = &Plant> {
        self.members.iter().map(|member| &member.plant)
    }

    /// What each plant met in the last advance.
    pub fn outcomes(&self) -> impl Iterator<Item = &Outcome> {
        self.members.iter().map(|member| &member.outcome)
    }

    /// Sets the drive of plant `index`, from the next advance on; false if there is no such plant.
    pub fn set_drive(&mut self, index: usize, drive: Drive) -> bool {
        let member = self.members.get_mut(index);
        member.map(|member| member.drive = drive).is_some()
    }
}

fn advance(members: &mut [Member], duration: f64) {
    for member in members.iter_mut() {
        member.plant.adopt(member.drive);
    }
    let (mut abreast, alone): (Vec<_>, Vec<_>) = members
        .iter_mut()
        .partition(|member| member.plant.gains_abreast(duration));
    for member in alone {
        member.outcome = member.plant.advance(member.drive, duration);
    }
    let arch = pulp::Arch::new();
    for row in abreast.chunks_mut(WIDTH) {
        if let Ok(row) = <&mut [&mut Member; WIDTH]>::try_from(&mut *row) {
            let plants = row.each_mut().map(|member| &mut member.plant);
            let runs = arch.dispatch(Row { plants, duration });
            for (member, run) in row.iter_mut().zip(runs) {
                member.finish(&run, duration);
            }
        } else {
            for member in row {
                member.outcome = member.plant.advance(member.drive, duration);
            }
        }
    }
}

/// Plants that go abreast: compiled anew for each set of vector instructions that a machine may have.
struct Row<'a> {
    plants: [&'a mut Plant; WIDTH],
    duration: f64,
}

impl NullaryFnOnce for Row<'_> {
    type Output = [Run; WIDTH];

    #[inline(always)]
    fn call(self) -> [Run; WIDTH] {
        Plant::cross_abreast(self.plants, self.duration)
    }
}

impl Member {
    /// Alone to the end of the advance.
    fn finish(&mut self, run: &Run, duration: f64) {
        self.outcome = if run.impacts == 0 {
            self.plant.advance(self.drive, duration)
        } else {
            self.plant.finish(run.left, duration)
        };
        self.outcome.impacts += run.impacts;
    }
}
