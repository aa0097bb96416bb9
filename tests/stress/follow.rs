//! One scene, and the worst that it shows.

use crate::common::Scene;
use crate::spacing::Spacing;
use crate::table::Table;
use lovines::plant::MOST_IMPACTS;
use lovines::{Cavity, Drive, Event, Plant, State};
use std::f64::consts::TAU;
use std::time::Instant;

/// Steps that each scene is followed for.
const STEPS: usize = 30;
/// A scene with so many impacts has shown what it is.
const ENOUGH: u64 = 100_000;
/// Where in a step the particle is looked for between its walls, as parts of the step.
const LOOKS: [f64; 3] = [0.181_818, 0.618_034, 0.927_051];
/// Steps with more impacts than these are not followed once more for looking inside.
const MOST_LOOKED_AT: u64 = 10_000;

/// Longest step of a particle without loss, 1/omega0: it hops on a wall that presses on it for ever, and each hop is followed.
const LONGEST_ELASTIC_STEP: f64 = 1.0;
/// Scenes with more impacts than these are followed once only.
const MOST_FOLLOWED_TWICE: u64 = 1_000_000;

/// The worst of one scene or of many, and which that was.
#[derive(Clone, Copy, Debug, Default)]
pub struct Worst {
    pub scenes: u64,
    pub panics: u64,
    pub impacts: u64,
    pub stuck: u64,
    pub released: u64,
    /// Sticks to the floor inside the cavity.
    pub sticks: u64,
    pub cut_short: u64,
    /// Of these, those that had not met as many impacts as that takes.
    pub cut_short_early: u64,
    pub not_a_number: u64,
    pub other_bits: u64,
    /// Scenes without loss whose steps were shortened to [`LONGEST_ELASTIC_STEP`], and scenes that were followed once only.
    pub shortened: u64,
    pub once_only: u64,
    /// Rigs that were at rest with nothing to move them, and moved.
    pub stirred: u64,
    /// Impacts from behind the wall, and events that the outcome does not count.
    pub miscounted: u64,
    /// Impacts that follow another one sooner than the motion allows.
    pub too_close: u64,
    /// `|w|/b - 1` at the ends of steps.
    pub outside: Hardest,
    /// The same inside steps.
    pub outside_within: Hardest,
    /// Growth of the energy without excitation within a step, relative to that at the start.
    pub growth: Hardest,
    /// What energy and dissipated energy miss of that at the start, without damping and excitation.
    pub missing: Hardest,
    pub impacts_per_period: Hardest,
    /// Evaluations of the motion per event and radian of the fastest rate.
    pub work: Hardest,
    pub slowest: Hardest,
}

/// The largest of a figure, and the scene that shows it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hardest {
    pub figure: f64,
    pub scene: Name,
}

/// The kind of a scene, and its number among these.
#[derive(Clone, Copy, Debug, Default)]
pub struct Name {
    pub kind: &'static str,
    pub number: usize,
}

impl Hardest {
    pub fn see(&mut self, figure: f64, scene: Name) {
        if figure > self.figure {
            *self = Self { figure, scene };
        }
    }

    pub fn or(self, other: Self) -> Self {
        if other.figure > self.figure { other } else { self }
    }

    /// What the figure is the worst of.
    pub fn among(&self, scenes: &str) -> String {
        let Name { kind, number } = self.scene;
        if kind.is_empty() {
            scenes.to_owned()
        } else {
            format!("{scenes}; worst: {kind} {number}")
        }
    }
}

impl Worst {
    /// A scene that panicked.
    pub fn panicked() -> Self {
        Self { scenes: 1, panics: 1, ..Self::default() }
    }

    pub fn and(self, other: Self) -> Self {
        Self {
            scenes: self.scenes + other.scenes,
            panics: self.panics + other.panics,
            impacts: self.impacts + other.impacts,
            stuck: self.stuck + other.stuck,
            released: self.released + other.released,
            sticks: self.sticks + other.sticks,
            cut_short: self.cut_short + other.cut_short,
            cut_short_early: self.cut_short_early + other.cut_short_early,
            not_a_number: self.not_a_number + other.not_a_number,
            other_bits: self.other_bits + other.other_bits,
            shortened: self.shortened + other.shortened,
            once_only: self.once_only + other.once_only,
            stirred: self.stirred + other.stirred,
            miscounted: self.miscounted + other.miscounted,
            too_close: self.too_close + other.too_close,
            outside: self.outside.or(other.outside),
            outside_within: self.outside_within.or(other.outside_within),
            growth: self.growth.or(other.growth),
            missing: self.missing.or(other.missing),
            impacts_per_period: self.impacts_per_period.or(other.impacts_per_period),
            work: self.work.or(other.work),
            slowest: self.slowest.or(other.slowest),
        }
    }

    pub fn rows(&self, table: &mut Table) {
        let among = format!("all {} scenes", self.scenes);
        for (what, worst, allowed) in [
            ("energy grows without excitation by, relative", self.growth, 1e-12),
            (
                "energy and dissipated energy miss, undamped, relative",
                self.missing,
                1e-12,
            ),
            (
                "outside the cavity inside steps by, in half-widths",
                self.outside_within,
                1e-12,
            ),
            ("impacts in a period, at most", self.impacts_per_period, f64::INFINITY),
            (
                "evaluations per event and radian of the fastest rate, at most",
                self.work,
                50.0,
            ),
        ] {
            table.row(what, &worst.among(&among), worst.figure, allowed);
        }
        let mut row = |what: &str, figure: f64, allowed: f64| table.row(what, &among, figure, allowed);
        row("panics", self.panics as f64, 0.0);
        row("states that are not numbers", self.not_a_number as f64, 0.0);
        row("impacts from behind a wall or not counted", self.miscounted as f64, 0.0);
        row("rigs at rest, particle at a wall, that move", self.stirred as f64, 0.0);
        row(
            "impacts sooner after another one than the motion allows",
            self.too_close as f64,
            0.0,
        );
        row(
            "advances cut short before their 10^7 impacts",
            self.cut_short_early as f64,
            0.0,
        );
        row(
            "advances that end at 10^7 impacts, and say so",
            self.cut_short as f64,
            f64::INFINITY,
        );
        row(
            "runs with other bits without the workspace",
            self.other_bits as f64,
            0.0,
        );
        row(
            "scenes followed once only, because of more than 10^6 impacts",
            self.once_only as f64,
            f64::INFINITY,
        );
        row(
            "scenes without loss whose steps are shortened to 1/omega0",
            self.shortened as f64,
            f64::INFINITY,
        );
    }
}

/// Follows a scene twice, unless it has very many impacts: the second time the plant loses its workspace before every step.
pub fn follow(scene: &Scene, name: Name) -> Worst {
    let began = Instant::now();
    let mut scene = scene.clone();
    let shortened = scene.parameters.restitution == 1.0 && scene.step > LONGEST_ELASTIC_STEP;
    if shortened {
        scene.step = LONGEST_ELASTIC_STEP;
    }
    let (mut worst, bits) = once(&scene, name, false);
    worst.shortened = u64::from(shortened);
    worst.slowest.see(began.elapsed().as_secs_f64(), name);
    if worst.impacts > MOST_FOLLOWED_TWICE {
        worst.once_only = 1;
    } else {
        worst.other_bits = u64::from(once(&scene, name, true).1 != bits);
    }
    worst
}

/// Largest `|w|/b - 1` at a few instants inside a step.
fn look(plant: &mut Plant, drive: Drive, step: f64) -> f64 {
    let (mut outside, mut gone) = (0.0f64, 0.0);
    for (n, part) in LOOKS.iter().enumerate() {
        let drive = if n == 0 { drive } else { plant.base().drive };
        plant.advance(drive, part * step - gone).unwrap();
        gone = part * step;
        let State { q1, q2, .. } = plant.state();
        // The difference of the two displacements carries their rounding.
        let rounding = 4.0 * f64::EPSILON * q1.abs().max(q2.abs());
        outside = outside.max(outside_by(plant, q1 - q2, rounding));
    }
    outside
}

/// How far `w` is outside the cavity, in its half-widths.
fn outside_by(plant: &Plant, w: f64, rounding: f64) -> f64 {
    let [plus, minus] = plant.parameters().gaps();
    ((w - plus).max(-w - minus) - rounding) / (0.5 * (plus + minus))
}

fn once(s: &Scene, name: Name, forgetful: bool) -> (Worst, [u64; 4]) {
    let mut plant = Plant::new(s.parameters, s.start).expect("a scene that makes sense");
    let mut worst = Worst { scenes: 1, ..Worst::default() };
    let free = s.drive.amplitude == 0.0 && s.drive.signal == [0.0; 4];
    let ideal = s.parameters.cavity == Cavity::IDEAL;
    let at_start = plant.energy(0.0);
    // The energy of a weight on a tilted axis has no natural zero.
    let (mut before, mut largest) = (at_start, at_start.abs());
    let mut drive = s.drive;
    for n in 0..STEPS {
        if forgetful {
            plant = Plant::from(plant.save());
        }
        if !ideal {
            drive.amplitude = s.drive.amplitude * (1.0 + 0.3 * (n % 5) as f64);
            drive.omega = s.drive.omega * (1.0 + 0.1 * (n % 3) as f64);
        }
        let (mut impacts, mut backwards) = (0u64, 0);
        let mut looked = plant;
        let mut spacing = Spacing::of(&plant, &drive, s.step);
        let outcome = plant
            .advance_with(drive, s.step, |event| {
                spacing.see(&event);
                if let Event::Impact { wall, velocity, .. } = event {
                    backwards += u64::from(wall.sign() * velocity <= 0.0);
                    impacts += 1;
                }
            })
            .unwrap();
        worst.too_close += if ideal { spacing.too_close() } else { 0 };
        if impacts <= MOST_LOOKED_AT {
            let inside = look(&mut looked, drive, s.step);
            worst.outside_within.see(inside, name);
        }
        // The same signal seen from now.
        drive = plant.base().drive;
        worst.miscounted += backwards + outcome.impacts.abs_diff(impacts);
        worst.impacts += impacts;
        worst.stuck += outcome.stuck;
        let early = outcome.cut_short && impacts < MOST_IMPACTS;
        worst.cut_short += u64::from(outcome.cut_short);
        worst.cut_short_early += u64::from(early);
        let State { q1, dq1, q2, dq2 } = plant.state();
        worst.not_a_number += u64::from(![q1, dq1, q2, dq2].iter().all(|x| x.is_finite()));
        worst
            .outside
            .see(outside_by(&plant, plant.relative_displacement(), 0.0), name);
        let fastest = s.parameters.fastest_rate().max(s.drive.omega.abs());
        let periods = (s.step * fastest / TAU).max(1.0);
        worst.impacts_per_period.see(impacts as f64 / periods, name);
        let events = impacts + outcome.stuck + outcome.released;
        let work = outcome.evaluations as f64 / (events as f64 + 1.0 + fastest * s.step);
        worst.work.see(work, name);
        if free && largest > 0.0 {
            let (now, lost) = (plant.energy(0.0), plant.totals().dissipated + plant.totals().friction);
            largest = largest.max(now.abs()).max(lost);
            worst.growth.see((now - before) / largest, name);
            if s.parameters.damping == 0.0 {
                let missing = (now + lost - at_start).abs() / largest;
                worst.missing.see(missing, name);
            }
            before = now;
        }
        worst.released += outcome.released;
        if worst.impacts + worst.released >= ENOUGH {
            break;
        }
    }
    let x = plant.state();
    worst.sticks = plant.totals().sticks;
    if free && ideal && at_start == 0.0 {
        worst.stirred = u64::from(x != s.start);
    }
    (worst, [x.q1, x.dq1, x.q2, x.dq2].map(f64::to_bits))
}
