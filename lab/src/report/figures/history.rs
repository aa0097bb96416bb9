//! Amplitude and frequency over time: while the loop seeks and holds phase resonance, and as the motion decays.

use std::f64::consts::TAU;

use nalgebra::DVector;

use super::{DECAY_LABEL, THINNED, decay_points};
use crate::comparison::Comparison;
use crate::numerics::{HarmonicBasis, range};
use crate::record::Record;
use crate::report::figure::{Axis, Figure, Legend, Panel, Place, amplitude, caption, line};
use crate::report::theme::{DECAY, EXACT, THEORY};
use crate::scene::Scene;
use crate::theory::{SlowFlow, backbone_at_level, reading};

const SIZE: (u32, u32) = (980, 760);
const UPPER: u32 = 400;
const LEFT: u32 = 520;
/// Most points of a curve.
const MOST: usize = 800;

/// What the two rows show: a time (periods), an amplitude and a detuning.
type Triple = [f64; 3];

/// Everything drawn.
struct Data<'a> {
    found: &'a Comparison,
    driven: Vec<Triple>,
    /// The decay, by theory and as identified.
    theory: Vec<Triple>,
    points: Vec<Triple>,
}

/// The four panels.
pub fn figure(record: &Record, scene: &Scene, found: &Comparison) -> Figure {
    let flow = SlowFlow::new(found.parameters.lambda, found.parameters.r);
    let per_period = found.parameters.epsilon * TAU;
    let fold = flow.manifold.c_min();
    let decay = backbone_at_level(&found.parameters, found.lock.at.c);
    let decay = decay.and_then(|point| flow.decay(point.b));
    let decay = decay.map(|decay| decay.samples(400)).unwrap_or_default();
    let points = found.decay.iter().map(|one| one.point);
    let data = Data {
        found,
        driven: driven(record, scene),
        theory: decay
            .iter()
            .map(|one| {
                let c = one.c * reading(&found.parameters, one.b, one.sigma);
                [one.tau1 / per_period, c, one.sigma]
            })
            .collect(),
        points: points
            .filter(|one| one.c >= 0.9 * fold)
            .step_by(THINNED / 2)
            .map(|one| [one.tau / TAU, one.c, one.sigma])
            .collect(),
    };
    let all = || data.driven.iter().chain(&data.points);
    let (_, top) = range((0.0, found.lock.at.c), data.driven.iter().map(|one| one[1]));
    let (low, high) = range((-1.5, 0.5), all().map(|one| one[2]));
    let margin = 0.1 * (high - low);
    let rows = [
        (1, (0.0, top * 1.35), amplitude(&found.parameters)),
        (2, (low - margin, high + margin), "detuning σ"),
    ];
    let panels = rows.into_iter().flat_map(|(row, range, label)| {
        let (top, height) = if row == 1 { (0, UPPER) } else { (UPPER, SIZE.1 - UPPER) };
        let left = data.driven_panel(row, (range, label));
        let right = data.decay_panel(row, range);
        [
            left.at([0, top, LEFT, height]),
            right.at([LEFT, top, SIZE.0 - LEFT, height]),
        ]
    });
    Figure::new(SIZE, panels.collect())
}

impl Data<'_> {
    fn driven_panel(&self, row: usize, y: Axis) -> Panel {
        let Comparison { parameters, lock, exact, theory, .. } = self.found;
        let end = 1.02 * self.driven.last().map_or(1.0, |one| one[0]);
        let mut panel = Panel::new(((0.0, end), "time, in periods of the oscillator alone"), y);
        if row == 1 {
            let caption = caption(parameters, lock.at.g);
            panel = panel.heading("Seeking and holding resonance", &caption);
        }
        let measured = self.driven.iter().map(|one| (one[0], one[row])).collect();
        panel.curve(measured, line(DECAY, 16), "measured");
        let level = |value: [f64; 2]| vec![(0.0, value[row - 1]), (end, value[row - 1])];
        if let Some(exact) = exact {
            let level = level([exact.c, exact.sigma]);
            panel.curve(level, line(EXACT, 14), "exact orbit");
        }
        if let Some(theory) = theory {
            let level = level([theory.c, theory.sigma]);
            panel.dashed(level, line(THEORY, 14), "first-order theory");
        }
        panel.legend(if row == 1 {
            Legend::LowerRight
        } else {
            Legend::UpperRight
        })
    }

    fn decay_panel(&self, row: usize, range: (f64, f64)) -> Panel {
        let last = self.points.last().map_or(1.0, |one| one[0]);
        let end = self.theory.last().map_or(last, |one| last.max(one[0]));
        let mut panel = Panel::new(((0.0, 1.02 * end), "time since the release, likewise"), (range, ""));
        if row == 1 {
            panel = panel.heading("Free decay", "the drive is off from 0 on");
        }
        let of = |one: &Triple| (one[0], one[row]);
        let inside = |one: &Place| (range.0..=range.1).contains(&one.1);
        let theory = self.theory.iter().map(of).filter(inside).collect();
        panel.dashed(theory, line(THEORY, 16), "first-order theory");
        decay_points(&mut panel, self.points.iter().map(of), DECAY_LABEL);
        panel.legend(Legend::UpperRight)
    }
}

/// Amplitude and commanded frequency up to the release, from windows of two periods: least squares of the response by the commanded
/// harmonic and a constant.
fn driven(record: &Record, scene: &Scene) -> Vec<Triple> {
    let d = scene.dimensionless();
    let dt = record.sample_time;
    let window = 2 * (d.natural_period() / dt).round().max(4.0) as usize;
    let samples = &record.samples[..record.released];
    let step = (samples.len() / MOST).max(window / 2);
    (0..samples.len().saturating_sub(window))
        .step_by(step)
        .filter_map(|from| {
            let part = &samples[from..from + window];
            let omega = part[window / 2].command.drive.omega;
            let phases: Vec<f64> = (0..window).map(|n| omega * dt * n as f64).collect();
            let values = part.iter().map(|sample| sample.sensors.response);
            let values = DVector::from_iterator(window, values);
            let fit = HarmonicBasis::new(&phases, 0, &[Some(0)]).fit(&values)?;
            let periods = d.omega0 * part[window / 2].time / TAU;
            Some([periods, fit.harmonic(1).norm() / d.b, d.sigma(omega)])
        })
        .collect()
}
