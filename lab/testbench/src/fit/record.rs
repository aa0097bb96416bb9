//! Fit of the five parameters to records themselves: the plant follows a record, and what it does not foresee is minimised.
//!
//! The plant is exact between events, so that no averaged equations, no held windows and no phase resonance are needed. It is driven by the measured
//! base, and predicts the response. Once in a period the first harmonic of the error of the prediction, the innovation, corrects the state of the
//! plant: a Kalman filter (Åström, Introduction to Stochastic Control Theory, chapter 7). Noise of the base is the noise of the process: its first
//! harmonic in a period moves the amplitude by `omega0 T/2 = pi` times itself. Noise of the response is the noise of the measurement. Both are
//! measured. Innovations are white, and their variance is known; so is the covariance of the parameters.
//!
//! The fit begins at the parameters of the points of the record. The plant must keep the 1:1 motion: where it loses it, has not two impacts per
//! period, does not forget its start, or where the innovations contradict their variances, a stretch does not belong, and is left out.

use std::f64::consts::{PI, TAU};

use lovines::{Cavity, Drive, Parameters, Plant, State};
use num_complex::Complex64;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use vines_model::numerics::{LeastSquares, Misfit, mean, mean_square, noise};
use vines_model::orbit::{AfterImpact, Orbit, backbone_at_speed, exact_backbone};
use vines_model::theory::{BranchSide, Manifold};
use vines_model::{Definition, Dimensionless, Sensor};

use super::{
    ChannelTest, Covariance, Fit, Kind, Known, LIMITS, MeasuredPoint, Nearest, Part, Problem, Recording, UNKNOWNS,
    Unknowns, plant, shifted, unknowns,
};

/// A stretch of a record: the number of the record, and the samples from which and to which it extends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stretch {
    record: usize,
    span: [usize; 2],
}

/// Periods of a piece: innovations are tested piece by piece.
const PIECE: usize = 16;
/// Longest gap between two parts of one stretch, periods.
const GAP: f64 = 20.0;
/// Doublings of the standard deviation along an axis at which the rise of chi-square is looked at.
const LONGEST: usize = 6;
/// Most rounds of fits and tests.
const ROUNDS: usize = 10;
/// Prior standard deviation of the amplitude at the start of a stretch, over the amplitude.
const PRIOR: f64 = 0.02;
/// Error of the prediction, over the response, at which the plant has lost the motion.
const LOST: f64 = 0.5;
/// Step of a difference.
const STEP: f64 = 1e-5;
/// Least gain of the correction in the first fit, in which the plant stays near the record whatever the parameters.
const STRONG: f64 = 0.2;
/// Gain of a further step, relative to one and chi-square, at which the minimum counts as found: in the first fit, and in the others.
const FOUND: [f64; 2] = [1e-3, 1e-5];
/// Probability of a piece that belongs to the motion to be left out, for all pieces together.
const FALSE_ALARM: f64 = 1e-3;

/// A record with its noise.
struct Measured<'a> {
    recording: &'a Recording,
    /// Standard deviations of the noise of response and base, m, in each piece of [`PIECE`] periods.
    noise: Vec<[f64; 2]>,
    /// Samples of a period.
    period: usize,
}

/// Records, of which some stretches are fitted, beside points.
struct Followed<'a> {
    problem: &'a Problem<'a>,
    records: &'a [Measured<'a>],
    stretches: Vec<Stretch>,
    /// Angular frequency at which harmonics are taken, rad/s.
    omega: f64,
    /// Least gain of the correction.
    least_gain: f64,
    /// Periods after the start of a stretch that are not counted: the particle forgets its start by a factor of r at each impact.
    forgotten: Vec<usize>,
}

/// How the plant followed a period.
#[derive(Clone, Copy)]
struct Period {
    /// Its first sample.
    begin: usize,
    /// Innovation over its standard deviation: in phase with the response, and in quadrature.
    innovation: [f64; 2],
    /// Impacts less two for each turn of the response.
    surplus: f64,
    /// Distance of the twin over the distance at the begin of the piece.
    spread: f64,
}

/// Relative difference of the particle's velocity between the plant and its twin.
const TWIN: f64 = 1e-6;

/// Distance of two states, m.
fn distance(plant: &Plant, twin: &Plant, omega: f64) -> f64 {
    let (one, other) = (plant.state(), twin.state());
    let positions = (one.q1 - other.q1).hypot(one.q2 - other.q2);
    positions.hypot((one.dq1 - other.dq1).hypot(one.dq2 - other.dq2) / omega)
}

/// Part of a record that does not belong to the motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// The record.
    pub origin: String,
    /// Its begin and end, s since the first sample.
    pub seconds: [f64; 2],
}

/// The fit to records.
#[derive(Debug, Clone)]
pub struct RecordFit {
    /// The parameters; residuals of points are beside those of the records.
    pub fit: Fit,
    /// Periods that are fitted.
    pub periods: usize,
    /// What is left out.
    pub left_out: Vec<LeftOut>,
    /// Correlation of the innovations of neighbouring periods: 0 if they are white.
    pub colour: f64,
}

/// Standard deviations of the noise in a record, and how it is read.
fn measured<'a>(recording: &'a Recording, omega: f64) -> Measured<'a> {
    let period = (TAU / omega / recording.sample_time).round() as usize;
    let pieces = recording
        .response
        .chunks(PIECE * period)
        .zip(recording.drive.chunks(PIECE * period));
    let mut noise: Vec<[f64; 2]> = pieces
        .map(|(response, drive)| [noise(response), noise(drive)])
        .collect();
    // The last piece may have few samples.
    if let [.., whole, last] = &mut noise[..] {
        *last = *whole;
    }
    Measured { recording, noise, period }
}

impl Measured<'_> {
    /// Variances of the first harmonics of response and base in the period that begins at a sample, m².
    fn variances(&self, begin: usize) -> [f64; 2] {
        let piece = (begin / (PIECE * self.period)).min(self.noise.len() - 1);
        self.noise[piece].map(|u| 2.0 * u * u / self.period as f64)
    }

    /// First harmonic of the values of a period that begins at the sample `from`: they are `Im(a exp(i omega t))`.
    fn harmonic(&self, omega: f64, from: usize, values: &[f64]) -> Complex64 {
        let step = omega * self.recording.sample_time;
        let turned = |(n, value): (usize, &f64)| Complex64::from_polar(*value, -step * (from + n) as f64);
        let sum: Complex64 = values.iter().enumerate().map(turned).sum();
        sum * Complex64::new(0.0, 2.0 / values.len() as f64)
    }

    /// The signal of the base from a sample to the next, a straight line, from `late` seconds after the sample on. `scale` makes up for
    /// the first harmonic of the polygon, which is smaller than that of the motion.
    fn line(&self, n: usize, late: f64, scale: f64) -> Drive {
        let Recording { drive, sample_time, .. } = self.recording;
        let slope = (drive[n + 1] - drive[n]) / sample_time;
        let signal = [scale * (drive[n] + slope * late), scale * slope, 0.0, 0.0];
        Drive { signal, ..Drive::default() }
    }
}

impl Followed<'_> {
    /// The plant on the exact motion whose response has the amplitude and phase of the first period of a stretch, with the time from the begin of
    /// the stretch at which it is there, s.
    fn start(&self, record: &Measured, parameters: &Parameters, from: usize) -> Option<(f64, State)> {
        let measured = record.harmonic(self.omega, from, &record.recording.response[from..from + record.period]);
        let d = Dimensionless {
            definition: self.problem.definition,
            ..Dimensionless::of(parameters, 0.0)
        };
        let manifold = Manifold::new(d.r);
        let by_theory = manifold.b(measured.norm() / d.b, BranchSide::Right);
        let [omega, c, _] = backbone_at_speed(&d, by_theory.unwrap_or(1.02 * manifold.b_min()))?;
        let distance = |orbit: &Orbit| (orbit.c - c).abs();
        let orbits = exact_backbone(&d, omega);
        let orbit = orbits
            .iter()
            .min_by(|one, other| distance(one).total_cmp(&distance(other)))?;
        // Phase of the response at the impact, less that at the sample.
        let step = self.omega * record.recording.sample_time;
        let rest = orbit.start.phase + orbit.gamma - (measured.arg() + step * from as f64);
        let AfterImpact { q1, dq1, q2, dq2, .. } = orbit.start;
        let ([q1, q2], [dq1, dq2]) = (
            [q1, q2].map(|one| one * d.b),
            [dq1, dq2].map(|one| one * d.b * d.omega0),
        );
        Some((rest.rem_euclid(TAU) / self.omega, State { q1, dq1, q2, dq2 }))
    }

    /// The periods of a stretch, up to the one in which the plant loses the motion.
    /// `tests`: beside a twin that starts each piece with another velocity of the particle.
    fn follow(&self, parameters: &Parameters, stretch: &Stretch, tests: bool) -> Option<Vec<Period>> {
        let record = &self.records[stretch.record];
        let Recording { response, drive, sample_time: dt, .. } = record.recording;
        let [from, to] = stretch.span;
        let period = record.period;
        let half = 0.5 * self.omega * dt;
        let scale = (half / half.sin()).powi(2);
        let (time, state) = self.start(record, parameters, from)?;
        let mut plant = Plant::new(*parameters, state).ok()?;
        let mut n = from + (time / dt) as usize;
        let late = time - (n - from) as f64 * dt;
        plant.advance(record.line(n, late, scale), dt - late).ok()?;
        n += 1;
        // What is counted begins at the same sample, whatever the parameters.
        while n < from + 2 * period {
            plant.advance(record.line(n, 0.0, scale), *dt).ok()?;
            n += 1;
        }
        let epsilon = match self.problem.definition.sensor {
            Sensor::V => parameters.mass_ratio(),
            Sensor::Q1 => 0.0,
        };
        let read = |state: &State| state.q1 + epsilon * state.q2;
        let twin_of = |plant: &Plant| {
            let mut twin = *plant;
            let State { q1, dq1, q2, dq2 } = plant.state();
            twin.set_state(State { q1, dq1, q2, dq2: dq2 * (1.0 + TWIN) }).ok()?;
            Some((twin, distance(plant, &twin, self.omega)))
        };
        let mut twin = twin_of(&plant)?;
        let mut variance = (PRIOR * record.harmonic(self.omega, from, &response[from..from + period]).norm()).powi(2);
        let (mut periods, mut errors) = (Vec::new(), Vec::with_capacity(period));
        let mut base = record.harmonic(self.omega, n - period, &drive[n - period..n]).norm();
        let mut last_response = record.harmonic(self.omega, n - period, &response[n - period..n]);
        while n + period < to {
            errors.clear();
            let (begin, before) = (n, plant.totals().impacts);
            for _ in 0..period {
                errors.push(response[n] - read(&plant.state()));
                let line = record.line(n, 0.0, scale);
                plant.advance(line, *dt).ok()?;
                if tests {
                    twin.0.advance(line, *dt).ok()?;
                }
                n += 1;
            }
            let [u_response, u_base] = record.variances(begin);
            let innovation = record.harmonic(self.omega, begin, &errors);
            let there = record.harmonic(self.omega, begin, &response[begin..n]);
            if innovation.norm() > LOST * there.norm() {
                break;
            }
            let total = variance + u_response;
            let turned = innovation * (there / there.norm()).conj() / total.sqrt();
            let turn = (there * last_response.conj()).arg() / TAU;
            last_response = there;
            let surplus = (plant.totals().impacts - before) as f64 - 2.0 * (1.0 + turn);
            let spread = distance(&plant, &twin.0, self.omega) / twin.1;
            periods.push(Period { begin, innovation: [turned.re, turned.im], surplus, spread });
            // Between two samples the amplitude of a base that changes is known to half of the change.
            let last = std::mem::replace(&mut base, record.harmonic(self.omega, begin, &drive[begin..n]).norm());
            let between = ((base - last) / (2 * period) as f64).powi(2);
            let gain = (variance / total).max(self.least_gain);
            variance = (1.0 - gain).powi(2) * variance + gain * gain * u_response + PI * PI * (u_base + between);
            // Both masses move, so that the particle keeps its place in the cavity.
            let now = innovation * gain * Complex64::from_polar(1.0, self.omega * dt * n as f64);
            let counted = periods.len() + PIECE - self.forgotten[stretch.record] % PIECE;
            if tests && counted.is_multiple_of(PIECE) {
                twin = twin_of(&plant)?;
            }
            let moved = |plant: &mut Plant| {
                let State { q1, dq1, q2, dq2 } = plant.state();
                let (dx, dv) = (now.im, self.omega * now.re);
                plant
                    .set_state(State { q1: q1 + dx, dq1: dq1 + dv, q2: q2 + dx, dq2 })
                    .ok()
            };
            moved(&mut plant)?;
            moved(&mut twin.0)?;
        }
        periods.drain(..periods.len().min(self.forgotten[stretch.record]));
        Some(periods)
    }

    /// The periods of all stretches; `None` where the plant loses the motion.
    fn all(&self, x: &Unknowns) -> Option<Vec<Vec<Period>>> {
        let parameters = plant(x, Cavity::IDEAL);
        let whole = |stretch: &Stretch| {
            let [_, to] = stretch.span;
            let periods = self.follow(&parameters, stretch, false)?;
            let end = periods.last()?.begin + 2 * self.records[stretch.record].period;
            (end >= to).then_some(periods)
        };
        self.stretches.iter().map(whole).collect()
    }

    /// The stretches without the pieces that do not belong to the motion of a plant, and these. `tests`: whether the innovations are tested.
    fn divided(&self, parameters: &Parameters, tests: bool) -> (Vec<Stretch>, Vec<Stretch>) {
        let (mut kept, mut left_out): (Vec<Stretch>, Vec<Stretch>) = (Vec::new(), Vec::new());
        let followed: Vec<Vec<Period>> = self
            .stretches
            .iter()
            .map(|stretch| self.follow(parameters, stretch, true).unwrap_or_default())
            .collect();
        let pieces = followed
            .iter()
            .map(|one| one.len().div_ceil(PIECE))
            .sum::<usize>()
            .max(1) as f64;
        let squares =
            |piece: &[Period]| -> f64 { piece.iter().flat_map(|one| one.innovation).map(|one| one * one).sum() };
        // A piece that does not belong bends the fit, so that others seem not to: the worst ones come first.
        let most = followed
            .iter()
            .flat_map(|one| one.chunks(PIECE))
            .map(squares)
            .fold(0.0, f64::max);
        let belongs = |piece: &[Period]| {
            let surplus: f64 = piece.iter().map(|one| one.surplus).sum();
            let p = ChiSquared::new(2.0 * piece.len() as f64).map_or(1.0, |one| one.sf(squares(piece)));
            let is_foreign = tests && p < FALSE_ALARM / pieces && squares(piece) > 0.5 * most;
            let is_stable = piece[piece.len() - 1].spread < 1.0;
            // One impact may lie on each limit of the piece.
            is_stable && surplus.abs() < 2.0 && !is_foreign
        };
        for (Stretch { record, span: [from, to] }, periods) in self.stretches.iter().zip(&followed) {
            let period = self.records[*record].period;
            let of = |from: usize, to: usize| Stretch { record: *record, span: [from, to] };
            let mut begin = *from;
            let mut reached = *from;
            for piece in periods.chunks(PIECE) {
                let [first, last] = [piece[0].begin, piece[piece.len() - 1].begin + period];
                if !belongs(piece) {
                    kept.push(of(begin, first));
                    left_out.push(of(first, last));
                    begin = last;
                }
                reached = last;
            }
            if reached + 2 * period < *to {
                // Lost: what follows may be another motion, or the same again.
                kept.push(of(begin, reached));
                let again = (reached + PIECE * period).min(*to);
                left_out.push(of(reached, again));
                begin = again;
            }
            kept.push(of(begin, *to));
        }
        let is_long = |stretch: &Stretch| {
            let [from, to] = stretch.span;
            to.saturating_sub(from) > (self.forgotten[stretch.record] + PIECE) * self.records[stretch.record].period
        };
        kept.retain(is_long);
        (kept, left_out)
    }
}

/// A minimum with its covariance.
type Scanned = (LeastSquares<UNKNOWNS, Vec<Nearest>>, Covariance);

impl Followed<'_> {
    /// The covariance of a minimum, from the rise of chi-square along its principal axes: the motion near the fold is not linear in the parameters,
    /// and derivatives alone may promise too much. Where chi-square is smaller on an axis, the search goes on from there.
    fn scanned(&self, mut minimum: LeastSquares<UNKNOWNS, Vec<Nearest>>) -> Scanned {
        for _ in 0..ROUNDS {
            let axes = minimum.covariance().symmetric_eigen();
            let mut lower: Option<(f64, Unknowns)> = None;
            let mut covariance = Covariance::zeros();
            for (variance, axis) in axes.eigenvalues.iter().zip(axes.eigenvectors.column_iter()) {
                let step = axis * variance.max(0.0).sqrt();
                // What no residual depends on is held: the strength of an effect, and without a scale the mass.
                if axis[6].abs() > 0.5 || !self.problem.has_scale && axis[5].abs() > 0.5 {
                    covariance += step * step.transpose();
                    continue;
                }
                let rise = |factor: f64| {
                    let ends = [-factor, factor].map(|factor| {
                        let x = minimum.x + step * factor;
                        let chi_square = self
                            .residuals(&x, &minimum.trace)
                            .map(|(one, _)| one.iter().map(|r| r * r).sum());
                        (chi_square.unwrap_or(f64::INFINITY) - minimum.chi_square, x)
                    });
                    ends.into_iter()
                        .min_by(|one, other| one.0.total_cmp(&other.0))
                        .unwrap_or((1.0, minimum.x))
                };
                // The first distance at which chi-square has risen by one.
                let mut scale = 1.0;
                for factor in std::iter::successors(Some(1.0), |factor| Some(2.0 * factor)).take(LONGEST) {
                    let (rise, x) = rise(factor);
                    if rise < -FOUND[0] && lower.as_ref().is_none_or(|(least, _)| rise < *least) {
                        lower = Some((rise, x));
                    }
                    scale = factor / rise.max(0.25).sqrt();
                    if rise >= 1.0 {
                        break;
                    }
                }
                covariance += step * step.transpose() * scale.max(1.0).powi(2);
            }
            let next = lower.and_then(|(_, x)| LeastSquares::minimum(self, x, &minimum.trace, FOUND[1]));
            match next.filter(|next| next.chi_square < minimum.chi_square) {
                Some(next) => minimum = next,
                None => return (minimum, covariance),
            }
        }
        let covariance = minimum.covariance();
        (minimum, covariance)
    }
}

impl Misfit<UNKNOWNS> for Followed<'_> {
    type Trace = Vec<Nearest>;

    fn residuals(&self, x: &Unknowns, near: &Vec<Nearest>) -> Option<(Vec<f64>, Vec<Nearest>)> {
        let (mut residuals, places) = self.problem.residuals(x, near)?;
        residuals.extend(self.all(x)?.concat().iter().flat_map(|one| one.innovation));
        Some((residuals, places))
    }

    fn derivatives(&self, x: &Unknowns, at: &Vec<Nearest>) -> Option<Vec<Unknowns>> {
        let mut rows = self.problem.derivatives(x, at)?;
        let innovations = |x: Unknowns| -> Option<Vec<f64>> {
            Some(self.all(&x)?.concat().iter().flat_map(|one| one.innovation).collect())
        };
        let here = innovations(*x)?;
        let columns: Option<Vec<Vec<f64>>> = (0..5).map(|i| innovations(shifted(x, i, STEP))).collect();
        let columns = columns?;
        let row = |n: usize| Unknowns::from_fn(|i, _| columns.get(i).map_or(0.0, |one| (one[n] - here[n]) / STEP));
        rows.extend((0..here.len()).map(row));
        Some(rows)
    }

    fn limits(&self) -> [[f64; 2]; UNKNOWNS] {
        LIMITS
    }
}

/// Neighbouring parts of a record at which it has points, as stretches.
fn stretches_of(record: usize, parts: &[Part], sample_time: f64, period: f64) -> Vec<Stretch> {
    let mut spans: Vec<[f64; 2]> = Vec::new();
    for part in parts.iter().filter(|part| part.point.is_some()) {
        match spans.last_mut() {
            Some([_, to]) if part.seconds[0] - *to < GAP * period => *to = part.seconds[1],
            _ => spans.push(part.seconds),
        }
    }
    let samples = |span: [f64; 2]| span.map(|time| (time / sample_time) as usize);
    spans
        .into_iter()
        .map(|span| Stretch { record, span: samples(span) })
        .collect()
}

/// Fits the five parameters to records and points. `recordings`: prepared records ([`Recording::prepared`]) with their parts; `start`: the plant of
/// the fit of all points. `None` for a decay, and where the plant does not follow half of the stretches.
#[must_use]
pub fn follow(
    recordings: &[Recording],
    parts: &[Vec<Part>],
    points: &[MeasuredPoint],
    definition: Definition,
    start: &Parameters,
    known: &[Known],
) -> Option<RecordFit> {
    // A decay crosses the fold, near which the errors of the parameters are far from normal.
    if parts.iter().flatten().any(|part| part.kind == Kind::Decay) {
        return None;
    }
    let omega = start.natural_frequency();
    let problem = Problem::new(points.to_vec(), definition, known);
    let records: Vec<Measured> = recordings.iter().map(|recording| measured(recording, omega)).collect();
    let stretches = records
        .iter()
        .zip(parts)
        .enumerate()
        .flat_map(|(n, (one, parts))| stretches_of(n, parts, one.recording.sample_time, TAU / omega))
        .collect();
    let forgotten = records.iter().map(|record| {
        let u = mean((0..record.noise.len()).map(|n| record.variances(n * PIECE * record.period)[0])).sqrt();
        let largest = record
            .recording
            .response
            .iter()
            .fold(0.0, |most: f64, one| most.max(one.abs()));
        // Until the start is below the noise.
        ((largest / u).ln() / (-2.0 * start.restitution.min(0.98).ln())).ceil() as usize
    });
    let forgotten = forgotten.collect();
    let mut followed = Followed {
        problem: &problem,
        records: &records,
        stretches,
        omega,
        least_gain: STRONG,
        forgotten,
    };
    let periods = |stretches: &[Stretch]| {
        let of = |Stretch { record, span: [from, to] }: &Stretch| (to - from) / records[*record].period;
        stretches.iter().map(of).sum::<usize>()
    };
    let whole = periods(&followed.stretches);
    let mut out: Vec<Stretch> = Vec::new();
    let mut cut = |followed: &mut Followed, x: &Unknowns, tests: bool| {
        let (kept, left_out) = followed.divided(&plant(x, Cavity::IDEAL), tests);
        followed.stretches = kept;
        let is_cut = !left_out.is_empty();
        out.extend(left_out);
        is_cut
    };
    let mut x = unknowns(start);
    while cut(&mut followed, &x, false) {}
    x = LeastSquares::minimum(&followed, x, &Vec::new(), FOUND[0])?.x;
    followed.least_gain = 0.0;
    let mut found = None;
    for _ in 0..ROUNDS {
        while cut(&mut followed, &x, false) {}
        let minimum = followed.scanned(LeastSquares::minimum(&followed, x, &Vec::new(), FOUND[1])?);
        x = minimum.0.x;
        found = Some(minimum);
        if !cut(&mut followed, &x, true) {
            break;
        }
        found = None;
    }
    let (minimum, covariance) = found.filter(|_| 2 * periods(&followed.stretches) >= whole)?;
    let innovations: Vec<[f64; 2]> = followed.all(&x)?.concat().iter().map(|one| one.innovation).collect();
    let count = innovations.len();
    let mut fit = problem.found(&minimum, &minimum.trace);
    fit.covariance = covariance;
    fit.degrees = (2 * count + problem.equations()).checked_sub(5 + usize::from(problem.has_scale))?;
    let channel = |i: usize| innovations.iter().map(move |one| one[i]);
    for i in 0..2 {
        fit.channels[i] = ChannelTest::of(channel(i).map(|one| one * one).sum(), count as f64 - 2.5);
    }
    let neighbours =
        |i: usize| mean(innovations.windows(2).map(|pair| pair[0][i] * pair[1][i])) / mean_square(channel(i));
    let left_out = out.iter().map(|Stretch { record, span }| {
        let Recording { origin, sample_time, .. } = &recordings[*record];
        LeftOut {
            origin: origin.clone(),
            seconds: span.map(|n| n as f64 * sample_time),
        }
    });
    let left_out = left_out.collect();
    Some(RecordFit {
        fit,
        periods: count,
        left_out,
        colour: 0.5 * (neighbours(0) + neighbours(1)),
    })
}
