//! Tests of `model_exchange/hybrid`: hops at a wall, and both interfaces of the FMU under a drive that changes at every
//! sample, with the ideal cavity and with friction, tilt, unequal gaps and all laws of restitution. `scripts/stress --plant` runs more
//! scenes (`SCENES`), and validation/stress.csv keeps the figures.

use super::*;
use lovines::{Cavity, Restitution};

const SPEED: f64 = 1e-4;

/// A particle `depth` half-widths behind the wall `w = b`, which it leaves; the spring presses the wall towards it.
fn behind_the_wall(depth: f64) -> Hybrid {
    let parameters = Parameters::dimensionless(0.1, 0.5, 0.5);
    let mut hybrid = Hybrid::new(parameters, State::default(), Drive::default()).unwrap();
    hybrid.states = States { q1: -3.0, q2: -4.0 - depth, u1: 0.0, u2: SPEED, phase: 0.0 };
    hybrid.begin_event();
    hybrid
}

fn resolved(hybrid: &mut Hybrid) -> Vec<(Event, Option<Rest>)> {
    let mut events = Vec::new();
    hybrid.resolve(1.0, |event, rest| events.push((event, rest)));
    events
}

#[test]
fn a_hop_that_the_integrator_does_not_resolve_ends_in_contact_and_its_energy_is_dissipated() {
    let mut hybrid = behind_the_wall(1e-9);
    let [(Event::Stuck { wall, .. }, Some(rest))] = resolved(&mut hybrid)[..] else {
        panic!("a rest expected");
    };
    assert_eq!((hybrid.contact(), wall), (Some(Contact::Wall(Wall::Plus)), Wall::Plus));
    let energy = 0.5 * (0.1 / 1.1) * SPEED * SPEED;
    assert!((rest.energy / energy - 1.0).abs() < 1e-9 && (rest.hop / (SPEED * SPEED / 6.0) - 1.0).abs() < 1e-9);
    assert!((hybrid.totals().dissipated / energy - 1.0).abs() < 1e-9);
}

#[test]
fn a_particle_that_leaves_its_wall_without_a_hop_behind_it_goes_on() {
    let mut on_the_wall = behind_the_wall(0.0);
    let mut after_a_jump = behind_the_wall(1e-9);
    after_a_jump.drive.signal[0] = -1e-3;
    for hybrid in [&mut on_the_wall, &mut after_a_jump] {
        assert_eq!(resolved(hybrid), []);
        assert_eq!((hybrid.contact(), hybrid.instant().dq2), (None, SPEED));
    }
}

/// Scenes, and how many fewer than in the stress test of the plant.
const SCENES: u64 = 150;
const FEWER: u64 = 25;
const SAMPLES: usize = 20;
/// Step of the integrator, in units of the fastest rate's time: with steps of 0.01 it jumps over low hops.
const STEP: f64 = 0.002;
/// Relative change of the start that shows how a sample spreads differences.
const CHANGE: f64 = 1e-7;

/// Marsaglia's xorshift generator (J. Stat. Softw. 8 (2003) 14), in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.next()
    }

    fn decades(&mut self, from: f64, to: f64) -> f64 {
        10f64.powf(self.between(from, to))
    }
}

/// What the particle is at rest on.
fn held(plant: &Plant) -> Option<Contact> {
    (plant.contact().map(Contact::Wall)).or(plant.sticks().then_some(Contact::Floor))
}

/// A master: the classical method of Runge and Kutta, and bisection for the events.
struct Master {
    hybrid: Hybrid,
    /// The drive as the sample begins.
    drive: Drive,
    /// How often the particle came to rest on a wall.
    rests: u64,
}

impl Master {
    /// The state of the plant at the start of a sample, changed by a relative amount, and the drive then.
    fn new(plant: &Plant, drive: Drive, change: f64) -> Self {
        let mut state = plant.state();
        let before = plant.base();
        let mut hybrid = Hybrid::new(*plant.parameters(), state, before.drive).unwrap();
        (state.dq1, state.dq2) = (state.dq1 * (1.0 + change), state.dq2 * (1.0 + change));
        hybrid.states.phase = before.phase.radians();
        hybrid.contact = held(plant);
        hybrid.totals = *plant.totals();
        hybrid.set_velocities(state.dq1, state.dq2);
        hybrid.begin_event();
        hybrid.drive = drive;
        let mut rests = 0;
        while hybrid.resolve(0.0, |_, rest| rests += u64::from(rest.is_some())) {}
        Self { hybrid, drive, rests }
    }

    /// The rig at `states`, `t` seconds after the sample began.
    fn at(&self, states: States, t: f64) -> Hybrid {
        let mut hybrid = Hybrid { states, ..self.hybrid };
        let [u0, u1, u2, u3] = self.drive.signal;
        hybrid.drive.signal[0] = u0 + t * (u1 + t * (u2 + t * u3));
        hybrid
    }

    fn step(&self, t: f64, h: f64) -> Hybrid {
        let rates = |hybrid: Hybrid| {
            let now = hybrid.instant();
            let (u1, u2) = now.reduced_accelerations();
            States { q1: now.dq1, u1, q2: now.dq2, u2, phase: now.omega }
        };
        let start = self.hybrid.states;
        let along = |rate: &States, h: f64| States {
            q1: start.q1 + h * rate.q1,
            u1: start.u1 + h * rate.u1,
            q2: start.q2 + h * rate.q2,
            u2: start.u2 + h * rate.u2,
            phase: start.phase + h * rate.phase,
        };
        let a = rates(self.at(start, t));
        let b = rates(self.at(along(&a, 0.5 * h), t + 0.5 * h));
        let c = rates(self.at(along(&b, 0.5 * h), t + 0.5 * h));
        let d = rates(self.at(along(&c, h), t + h));
        let mean = |of: fn(&States) -> f64| (of(&a) + 2.0 * (of(&b) + of(&c)) + of(&d)) / 6.0;
        let rate = States {
            q1: mean(|s| s.q1),
            u1: mean(|s| s.u1),
            q2: mean(|s| s.q2),
            u2: mean(|s| s.u2),
            phase: mean(|s| s.phase),
        };
        self.at(along(&rate, h), t + h)
    }

    /// Displacement and velocity of the primary mass, relative displacement and velocity after the sample, the totals, and rests on a
    /// wall.
    fn run(mut self, duration: f64) -> ([f64; 4], Totals, u64) {
        let longest = STEP / self.hybrid.parameters.fastest_rate().max(self.drive.omega.abs());
        let mut t = 0.0;
        while t < duration {
            let h = longest.min(duration - t);
            let end = self.step(t, h);
            if !end.overdue() {
                self.hybrid = end;
                t += h;
                continue;
            }
            let (mut before, mut behind) = (0.0, h);
            for _ in 0..60 {
                let middle = 0.5 * (before + behind);
                *(if self.step(t, middle).overdue() {
                    &mut behind
                } else {
                    &mut before
                }) = middle;
            }
            self.hybrid = self.step(t, behind);
            t += behind;
            self.hybrid.begin_event();
            while (self.hybrid).resolve(t, |_, rest| self.rests += u64::from(rest.is_some())) {}
        }
        self.hybrid.time = duration;
        let now = self.hybrid.instant();
        let motion = [now.q1, now.dq1, now.relative_displacement(), now.relative_velocity()];
        (motion, self.hybrid.totals(), self.rests)
    }
}

/// Any of the effects, with gravity of the size of the accelerations of the rig and far smaller.
fn rough(random: &mut Random) -> Cavity {
    let gravity = 1.0 / lovines::cavity::GRAVITY;
    let mut cavity = Cavity { seed: random.0, ..Cavity::IDEAL };
    let mut with = |share: f64| random.next() < share;
    let [gaps, tilt, friction, laws, scatter] = [0.5, 0.5, 0.7, 0.5, 0.3].map(&mut with);
    if gaps {
        (cavity.b_plus, cavity.b_minus) = (Some(random.between(0.7, 1.3)), Some(random.between(0.7, 1.3)));
    }
    if tilt {
        cavity.tilt = random.between(-1.0, 1.0) * gravity;
    }
    if friction {
        cavity.kinetic_friction = random.decades(-2.5, 0.5) * gravity;
        cavity.static_friction = (random.next() < 0.5).then_some(cavity.kinetic_friction * random.between(1.0, 2.0));
    }
    if laws {
        cavity.restitution = [
            Some(Restitution::Viscoelastic(random.between(0.0, 0.5))),
            Some(Restitution::Plastic(random.decades(-2.0, 0.0))),
        ];
        cavity.least_restitution = 0.05;
    }
    if scatter {
        cavity.scatter = random.between(0.0, 0.2);
    }
    cavity
}

/// Both interfaces sample by sample; prints the figures.
fn compare(name: &str, cavities: fn(&mut Random) -> Cavity) {
    let scenes = std::env::var("SCENES").map_or(SCENES, |n| n.parse::<u64>().expect("a number of scenes") / FEWER);
    // A rebound of the lowest hop has this speed where the wall presses with `8 omega0² b`.
    let allowed = 4.0 * LOWEST_HOP.sqrt();
    let (mut worst, mut held_samples, mut impacts, mut sticks) = (0.0f64, 0u64, 0u64, 0u64);
    for number in 1..=scenes {
        let mut random = Random(number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let r = random.between(0.05, 0.8);
        let mut parameters = Parameters::dimensionless(random.decades(-2.0, 0.0), 0.0, r);
        // Model exchange does not know the slope of a signal, which matters with damping only.
        let slopes = random.next() < 0.3;
        if !slopes {
            parameters.damping = random.decades(-2.0, 1.0);
        }
        parameters.cavity = cavities(&mut random);
        let q1 = random.between(-1.0, 1.0);
        let wall = if random.next() < 0.5 { Wall::Plus } else { Wall::Minus };
        let w = wall.sign() * parameters.gaps()[wall.index()];
        let mut plant = Plant::new(parameters, State { q1, q2: q1 - w, ..State::default() }).unwrap();
        plant
            .begin(Drive::harmonic(random.decades(-1.0, 0.5), random.between(0.0, 3.0)))
            .unwrap();
        for sample in 0..SAMPLES {
            let Drive { mut signal, mut amplitude, .. } = plant.base().drive;
            if slopes {
                signal[1..].fill_with(|| random.between(-1.0, 1.0));
            }
            // Half of the changes are without a jump.
            if random.next() < 0.5 {
                signal[0] = random.between(-1.0, 1.0);
                amplitude = random.decades(-1.0, 0.5);
            }
            let drive = Drive { signal, amplitude, omega: random.between(-1.0, 3.0) };
            let step = random.decades(-2.0, 0.3);
            let [(exchanged, totals, rests), (changed, ..)] =
                [0.0, CHANGE].map(|change| Master::new(&plant, drive, change).run(step));
            let before = *plant.totals();
            let outcome = plant.advance(drive, step).unwrap();
            held_samples += u64::from(held(&plant).is_some());
            // After a chatter the coefficients of restitution belong to impacts of other numbers.
            if parameters.cavity.scatter > 0.0 && outcome.stuck > 0 {
                continue;
            }
            let state = plant.state();
            let stepped = [
                state.q1,
                state.dq1,
                plant.relative_displacement(),
                plant.relative_velocity(),
            ];
            let size = [state.q1, state.dq1, state.dq2, amplitude, 1.0]
                .into_iter()
                .fold(0.0f64, |size, x| size.max(x.abs()));
            let difference =
                |a: &[f64], b: &[f64]| (a.iter().zip(b)).fold(0.0f64, |most, (a, b)| most.max((a - b).abs())) / size;
            let scale = 1.0 + difference(&changed, &exchanged) / CHANGE;
            let figure = difference(&stepped, &exchanged) / scale;
            assert!(
                figure < allowed,
                "scene {number}, sample {sample}: {figure:e}\n{stepped:?}\n{exchanged:?}\n{:?}",
                parameters.cavity
            );
            worst = worst.max(figure);
            let now = *plant.totals();
            let energy = parameters.particle_mass * size;
            // The last hop at a wall, of 1e-10 half-widths, ends on the floor in one and on the wall in the other.
            let stuck_time = if outcome.stuck + rests == 0 {
                totals.stuck_time
            } else {
                now.stuck_time
            };
            for (a, b, unit) in [
                (now.dissipated, totals.dissipated, energy),
                (now.friction, totals.friction, energy),
                (now.stuck_time, stuck_time, 1.0),
            ] {
                let figure = difference(&[a / unit], &[b / unit]) / scale;
                assert!(
                    figure < 10.0 * allowed,
                    "scene {number}, sample {sample}: {figure:e} {now:?} {totals:?}"
                );
            }
            impacts += now.impacts - before.impacts;
            sticks += now.sticks - before.sticks;
        }
    }
    println!(
        "| new drive at every sample, {name}: both interfaces of the FMU differ by, relative | {scenes} scenes, {} samples, {held_samples} \
         of them end at rest | {worst:.1e} | {allowed:.1e} |",
        scenes * SAMPLES as u64
    );
    assert!(
        held_samples > scenes / 2 && impacts > scenes || scenes < SCENES,
        "{held_samples} {impacts} {sticks}"
    );
    println!("{impacts} impacts, {sticks} sticks");
}

#[test]
fn both_interfaces_agree_on_drives_that_change_at_every_sample() {
    compare("ideal cavity", |_| Cavity::IDEAL);
}

#[test]
fn both_interfaces_agree_with_friction_tilt_gaps_and_every_law_of_restitution() {
    compare("real cavity", rough);
}
