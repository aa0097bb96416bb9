//! Walls just before the farthest point of a motion, and just beyond it, for random rigs and drives.

use crate::common::{Scene, scene};
use crate::random::draw;
use crate::table::Table;
use lovines::base_motion::BaseMotion;
use lovines::oscillator::Oscillator;
use lovines::segment::Segment;
use lovines::{Drive, Parameters, Plant, State};
use proptest::prelude::*;
use rayon::prelude::*;

/// How long the motion is followed, in units of `1/omega0`, and in how many looks its farthest point is searched for.
const DURATION: f64 = 15.0;
const LOOKS: u32 = 3000;

/// Where the primary mass, from the centre of the cavity on, goes farthest within the duration; `None` if it goes
/// as far at its end.
fn farthest(s: &Scene) -> Option<f64> {
    let p = s.parameters;
    let oscillator = Oscillator::new(p.primary_mass, p.stiffness, p.damping);
    let base = BaseMotion { drive: s.drive, ..BaseMotion::default() };
    let motion = Segment::new(&oscillator, base, (0.0, s.start.dq1));
    let step = DURATION / f64::from(LOOKS);
    let at = |t: f64| motion.derivatives(t)[0].abs();
    let looks: Vec<f64> = (0..=LOOKS).map(|n| at(f64::from(n) * step)).collect();
    let end = looks[looks.len() - 1];
    let mut farthest = 0.0f64;
    for (n, near) in looks.windows(3).enumerate() {
        if near[1] < near[0] || near[1] < near[2] {
            continue;
        }
        // With hardly any damping one extreme is as far as the other but for the last digits: each is worked out.
        let mut t = (n as f64 + 1.0) * step;
        for _ in 0..20 {
            let d = motion.derivatives(t);
            t -= d[1] / d[2];
        }
        farthest = farthest.max(at(t));
    }
    (farthest > end * 1.02).then_some(farthest)
}

/// Impacts within the duration: in one step, in many, and by the general search alone.
fn impacts(s: &Scene, half_width: f64) -> [u64; 3] {
    let parameters = Parameters { half_width, ..s.parameters };
    let start = State { dq1: s.start.dq1, ..State::default() };
    [(true, 1), (true, 150), (false, 1)].map(|(fast, steps)| {
        let mut plant = Plant::new(parameters, start).expect("a scene that makes sense");
        plant.set_fast_path(fast);
        for _ in 0..steps {
            plant.advance(s.drive, DURATION / f64::from(steps)).unwrap();
            if plant.totals().impacts > 0 {
                break;
            }
        }
        plant.totals().impacts
    })
}

/// Overshoots missed and undershoots reported.
#[derive(Default)]
struct Grazes {
    scenes: u64,
    missed: u64,
    invented: u64,
}

fn graze(s: &Scene) -> Grazes {
    let Some(farthest) = farthest(s) else {
        return Grazes::default();
    };
    let mut grazes = Grazes { scenes: 1, ..Grazes::default() };
    for exponent in 2..=13 {
        let delta = 10f64.powi(-exponent);
        let none = |impacts: [u64; 3]| impacts.iter().filter(|n| **n == 0).count() as u64;
        grazes.missed += none(impacts(s, farthest * (1.0 - delta)));
        grazes.invented += 3 - none(impacts(s, farthest * (1.0 + delta)));
    }
    grazes
}

pub fn both_ways(n: usize, table: &mut Table) {
    let strategy = || {
        (scene(true), any::<bool>(), 0.1..2.0f64).prop_map(|(mut s, driven, speed)| {
            s.start.dq1 = speed;
            if !driven {
                s.drive = Drive::default();
            }
            s
        })
    };
    let all = (0..n)
        .into_par_iter()
        .map_init(|| strategy().boxed(), |strategy, number| graze(&draw(strategy, number)))
        .reduce(Grazes::default, |a, b| Grazes {
            scenes: a.scenes + b.scenes,
            missed: a.missed + b.missed,
            invented: a.invented + b.invented,
        });
    assert!(all.scenes > n as u64 / 10);
    let among = format!("{} motions, 12 depths, 3 ways", all.scenes);
    table.row(
        "overshoots of 1e-2 to 1e-13 of the half-width missed",
        &among,
        all.missed as f64,
        0.0,
    );
    table.row(
        "undershoots of 1e-2 to 1e-13 of the half-width reported",
        &among,
        all.invented as f64,
        0.0,
    );
    table.progress("grazes");
}
