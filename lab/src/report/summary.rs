//! Summaries for a terminal.

use super::table::{Table, number, with_uncertainty};
use crate::comparison::{COMPARED_ABOVE, Comparison, TrackedComparison, TrackedPoint};
use crate::identification::{DecayEnd, Regime};
use crate::scene::{Definition, Dimensionless, Sensor};
use crate::sweep::Map;

/// Periods over which the ripple of an acceleration averages out.
const RIPPLE: usize = 200;

/// The numbers that a result belongs to, in one line.
pub fn parameters(p: &Dimensionless) -> String {
    let definition = match p.definition == Definition::default() {
        true => String::new(),
        false => format!("; resonance: {}", p.definition.name()),
    };
    format!("{}, G = {:.4}{definition}", rig(p), p.g)
}

fn rig(p: &Dimensionless) -> String {
    let Dimensionless { epsilon, lambda, r, .. } = p;
    format!("epsilon = {epsilon:.6}, lambda = {lambda:.4}, r = {r}")
}

/// Frequency in hertz, amplitude of the response and of the base in metres, with their uncertainties.
fn in_si([frequency, response, base]: [(f64, f64); 3]) -> [String; 3] {
    let metres = |(value, u): (f64, f64)| format!("{value:.5e} ± {u:.1e}");
    [
        with_uncertainty(frequency.0, frequency.1),
        metres(response),
        metres(base),
    ]
}

/// How often each regime occurs on a map.
pub fn regimes(map: &Map) -> Table {
    let inside = map.cells.iter().filter(|cell| cell.theory_stable).count();
    let share = |count: usize, of: usize| match of {
        0 => "-".into(),
        _ => format!("{:.1} %", 100.0 * count as f64 / of as f64),
    };
    let rows = Regime::SIMULATED.into_iter().map(|regime| {
        let (all, here) = map.count(regime);
        let shares = [share(all, map.cells.len()), share(here, inside)];
        [vec![regime.name().to_string(), all.to_string()], shares.into()].concat()
    });
    Table::new("regime | cells | share | inside the theory's stable island").rows(rows)
}

/// An identification: the locked point beside theory and exact orbit, then the decay.
pub fn identification(found: &Comparison) -> String {
    let lock = &found.lock;
    let row = |name: &str, sigma: f64, c: f64, b: Option<f64>| {
        [name.to_string(), number(sigma), number(c), b.map_or("-".into(), number)]
    };
    let b = lock.b.zip(lock.u_b).map_or("-".into(), |(b, u)| with_uncertainty(b, u));
    let [sigma, c] =
        [(lock.at.sigma, lock.at.u_sigma), (lock.at.c, lock.at.u_c)].map(|(value, u)| with_uncertainty(value, u));
    let measured = ["measured at the lock".to_string(), sigma, c, b];
    let exact = found.exact.iter();
    let exact = exact.map(|one| row("exact orbit", one.sigma, one.c, Some(one.b)));
    let theory = found.theory.iter();
    let theory = theory.map(|one| row("theory, first order", one.sigma, one.c, Some(one.b)));
    let table = Table::new(" | sigma | C | B").rows([measured]).rows(exact).rows(theory);
    let alone = found.exact.is_none() && found.theory.is_none();
    let note = if alone {
        "  (theory and exact orbits are for phase resonance, -90 degrees; there is none to compare with)\n"
    } else {
        ""
    };
    let ripple = if found.parameters.definition.sensor == Sensor::Acceleration && lock.averaged < RIPPLE {
        "  (the impacts leave a ripple on an acceleration: hold 200 periods, record.hold_periods, for 1e-3 in sigma and C)\n"
    } else {
        ""
    };
    let tone = lock.tone.map_or_else(String::new, |tone| {
        format!("  ({tone}: more than the particle can cause, so it is no part of the motion; check the cable of the sensor)\n")
    });
    let [hertz, response, base] = in_si([
        (lock.at.f_hz, lock.at.u_f_hz),
        (lock.at.a_m, lock.at.u_a_m),
        (lock.at.e_m, lock.at.u_e_m),
    ]);
    format!(
        "Measured: {hertz} Hz, response {response} m, base {base} m\n{}, G = {}\nLocked after {:.0} periods{}: {}, {}, phase error {:.1e} ± {:.1e} degrees\n\n{}{note}{ripple}{tone}{}\n{}\n{}\n",
        rig(&found.parameters),
        with_uncertainty(lock.at.g, lock.at.u_g),
        lock.periods_to_lock,
        if lock.held {
            " (the response is held by control: a constant drive would not hold it)"
        } else {
            ""
        },
        lock.regime,
        lock.impacts(),
        lock.at.phase_error_deg,
        lock.at.u_phase_deg,
        table.text(),
        others(found),
        decay(found),
        agreement(found)
    )
}

/// The phase-resonant orbits at this G that the lock did not follow, where there is more than one that a loop could lock.
fn others(found: &Comparison) -> String {
    let mut text: String = found
        .others()
        .map(|orbit| {
            format!(
                "  (another stable orbit at this G, not followed: sigma = {:.4}, C = {:.4}, B = {:.4})\n",
                orbit.sigma, orbit.c, orbit.b
            )
        })
        .collect();
    if found.exact.as_ref().is_some_and(|exact| !exact.stable) {
        text += "  (the nearest exact orbit is unstable under a constant drive and frequency; the loop holds it)\n";
    }
    text
}

fn decay(found: &Comparison) -> String {
    let end = match found.decay_end {
        DecayEnd::Synchrony => "where the impacts lose synchrony",
        DecayEnd::Linear => "where the impacts end",
        DecayEnd::Record => "where the record ends; a larger record.decay_periods shows more",
    };
    let (Some(first), Some(last)) = (found.decay.first(), found.decay.last()) else {
        return format!(
            "Free decay: no points, because it is shorter than the window of the fit; it ends {end}. A shorter record.window_periods may help"
        );
    };
    format!(
        "Free decay: {} points from C = {:.4} down to {:.4}, {end}",
        found.decay.len(),
        first.point.c,
        last.point.c
    )
}

fn agreement(found: &Comparison) -> String {
    let Some(rms) = found.rms_sigma_error else {
        return format!("No point of the decay lies above C = {COMPARED_ABOVE}");
    };
    let exact = found.rms_sigma_exact.zip(found.rms_sigma_predicted).map_or(String::new(), |(raw, predicted)| {
        format!("\nRMS of sigma against the exact backbone: {raw:.4}; against the decay that the exact plant predicts: {predicted:.4}")
    });
    format!(
        "RMS of sigma against theory over C > {COMPARED_ABOVE}: {rms:.4} (theory is of first order in epsilon){exact}"
    )
}

/// The points of a tracked backbone, and what they cost.
pub fn tracked(found: &TrackedComparison) -> String {
    let on_a_rig = found.points.iter().all(|one| one.point.regime_by_impacts.is_none());
    let si = if on_a_rig {
        "frequency, Hz | response, m | base, m | "
    } else {
        ""
    };
    let rows = found.points.iter().map(|TrackedPoint { point, exact }| {
        let regime = match point.regime_by_impacts {
            Some(by_impacts) => format!("{} / {by_impacts}", point.regime),
            None => point.regime.to_string(),
        };
        let settled = if point.settled { "" } else { "; not settled" };
        let reached = if point.reached {
            String::new()
        } else {
            format!("; level {:.3} not reached", point.level)
        };
        let tone = point.tone.map_or_else(String::new, |tone| format!("; {tone}"));
        let pairs = [
            (point.at.c, point.at.u_c),
            (point.at.sigma, point.at.u_sigma),
            (point.at.g, point.at.u_g),
        ];
        let mut cells = Vec::new();
        if on_a_rig {
            cells.extend(in_si([
                (point.at.f_hz, point.at.u_f_hz),
                (point.at.a_m, point.at.u_a_m),
                (point.at.e_m, point.at.u_e_m),
            ]));
        }
        cells.extend(pairs.map(|(value, u)| with_uncertainty(value, u)));
        let equal = exact.and_then(|exact| Some(exact.sigma?.abs().max(exact.g?.abs())));
        cells.extend([
            format!("{:+.2}°", point.at.phase_error_deg),
            format!("{:.1}", point.periods),
            point.averaged.to_string(),
            equal.map_or("-".into(), |error| format!("{error:.1e}")),
            regime + settled + &reached + &tone,
        ]);
        cells
    });
    let headings = "C | sigma | G | off target | periods | averaged | error | regime by response / by impacts";
    let table = Table::new(&format!("{si}{headings}")).rows(rows);
    let worst = found.worst().map_or(String::new(), |worst| {
        format!(
            "Largest error of a settled point, in sigma or G against the exact backbone at the same C: {:.1e} (distance from the nearest \
             place of the curve: {:.1e})\n",
            worst.at_equal_c, worst.nearest
        )
    });
    format!(
        "{}\n\n{}\n{} points in {:.0} periods, {:.1} of which before the loop held the response: {:.1} periods per point\n{worst}",
        rig(&found.parameters),
        table.text(),
        found.points.len(),
        found.periods,
        found.periods_to_lock,
        found.periods_per_point()
    )
}
