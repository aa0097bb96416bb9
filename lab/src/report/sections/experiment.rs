//! The experiment: lock, hold, release, decay.

use std::cell::Cell;
use std::error::Error;

use crate::comparison::{COMPARED_ABOVE, Comparison};
use crate::experiment::{self, ExperimentError, Plan, Stage};
use crate::identification::{DecayEnd, identify};
use crate::record::Record;
use crate::report::figures::{backbone, history, manifold};
use crate::report::files::{ReportError, decay_csv, json};
use crate::report::section::{Section, Subject};
use crate::report::table::{Table, number};
use crate::rig::{BuiltIn, Rig, Simulated};

pub(super) fn make(subject: &Subject, done: &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError> {
    let mut section = Section::new("The experiment");
    let scene = &subject.scene;
    let mut rig = Simulated::of(scene)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = match recorded(rig.as_mut(), &mut controller, &Plan::of(scene), done) {
        Ok(record) => record,
        Err(error) => return Ok(without_backbone(section, &error)),
    };
    let found = match identify(&record, scene) {
        Ok(found) => Comparison::of(&found, scene),
        Err(error) => return Ok(without_backbone(section, &error)),
    };
    describe(&mut section, &found, found.phase_target_deg);
    section.figure(
        "history",
        "Amplitude and frequency over time. Left: the loop searches for phase resonance and holds it; measured once per period. Right: \
         the drive is off, and the motion decays along the backbone until the impacts lose synchrony at the fold. \
         Times are in periods 2π/ω₀ of the oscillator alone.",
        history::figure(&record, scene, &found).svg()?,
    );
    section.figure(
        "decay-on-sim",
        "The decay on the slow invariant manifold, from the locked point (square) down the right branch to its fold.",
        manifold::figure(&found).svg()?,
    );
    section.figure(
        "identified-backbone",
        "The identified backbone: points along the decay (circles), the locked point (square), the exact curve and first-order theory.",
        backbone::figure(&found).svg()?,
    );
    section.attach("backbone.csv", decay_csv(&found)?);
    section.attach("identification.json", json(&found)?);
    Ok(section)
}

/// Runs the experiment and reports its progress in steps of a hundredth.
fn recorded(
    rig: &mut dyn Rig,
    controller: &mut BuiltIn,
    plan: &Plan,
    done: &(dyn Fn(f64) + Sync),
) -> Result<Record, ExperimentError> {
    let reported = Cell::new(0.0);
    experiment::run(rig, controller, plan, |stage, at, of| {
        let part = at as f64 / of.max(1) as f64;
        // Most locks come long before the time limit.
        let part = match stage {
            Stage::Locking => 0.6 * part,
            Stage::Holding | Stage::Tracking => 0.6 + 0.1 * part,
            Stage::Decaying => 0.7 + 0.2 * part,
        };
        if part > reported.get() + 0.01 {
            reported.set(part);
            done(part);
        }
    })
}

fn without_backbone(mut section: Section, error: &dyn Error) -> Section {
    section.found(format!("The experiment gave no backbone: {error}."));
    section
}

fn describe(section: &mut Section, found: &Comparison, target: f64) {
    let lock = &found.lock;
    section.finding = format!(
        "The loop locked after {:.0} periods at σ = {:.4}, C = {:.4}, in the regime {}.",
        lock.periods_to_lock, lock.at.sigma, lock.at.c, lock.regime
    );
    section.words(format!(
        "A sampled phase-locked loop drove the base at G = {:.4} and searched for the frequency at which the centre of mass {} the \
         base by {} degrees. It settled after {:.0} periods with {:.3} impacts per period and a phase error of {:.1e} degrees. A phase \
         lock alone is not sufficient evidence, because the linear mode locks as well. Here the impacts alternate between the walls at \
         even intervals: this is the symmetric 1:1 regime.",
        lock.at.g,
        if target <= 0.0 { "lags" } else { "leads" },
        target.abs(),
        lock.periods_to_lock, lock.impacts_per_period, lock.at.phase_error_deg
    ));
    describe_lock(section, found);
    if let (Some(first), Some(last)) = (found.decay.first(), found.decay.last()) {
        section.words(format!(
            "Then the drive was switched off. The motion decayed from C = {:.4} to C = {:.4} ({} ended the points). \
             During the decay it moved along the backbone, and {} points of the backbone were identified.",
            first.point.c,
            last.point.c,
            match found.decay_end {
                DecayEnd::Synchrony => "the loss of synchrony",
                DecayEnd::Linear => "the end of the impacts",
                DecayEnd::Record => "the end of the record",
            },
            found.decay.len()
        ));
    }
    if let Some((raw, predicted)) = found.rms_sigma_exact.zip(found.rms_sigma_predicted) {
        section.budget(
            "decay against the exact backbone",
            format!("RMS {raw:.4} in σ over C > {COMPARED_ABOVE}"),
            "The backbone is made of steady motions. The impacts follow a falling amplitude late.",
        );
        section.budget(
            "decay against its prediction",
            format!("RMS {predicted:.4} in σ over C > {COMPARED_ABOVE}"),
            "The exact plant is released on the exact orbit and evaluated alike.",
        );
    }
    if let Some(rms) = found.rms_sigma_error {
        section.budget(
            "decay against theory",
            format!("RMS {rms:.4} in σ over C > {COMPARED_ABOVE}"),
            "Theory and exact orbits describe steady motions; this one loses several per cent of its amplitude in every period. \
             This difference is also of first order in ε.",
        );
    }
    section.budget(
        "plant",
        "1e-13 relative".into(),
        "Between events the motion is computed in closed form, without a step-size error. Tests compare it with 40-digit arithmetic \
         (8e-14 over 200 periods and 400 impacts).",
    );
}

/// The locked point beside exact orbit and theory.
fn describe_lock(section: &mut Section, found: &Comparison) {
    let lock = &found.lock;
    let cells = |name: &str, sigma: f64, c: f64, b: Option<f64>| {
        let b = b.map_or("–".into(), number);
        [name.to_string(), number(sigma), number(c), b]
    };
    let mut rows = vec![cells("measured at the lock", lock.at.sigma, lock.at.c, lock.b)];
    let percent = |c: f64, reference: f64| 100.0 * (c / reference - 1.0).abs();
    if let Some(exact) = &found.exact {
        rows.push(cells("exact orbit", exact.sigma, exact.c, Some(exact.b)));
        let others = found.others();
        rows.extend(others.map(|one| cells("another stable orbit, not followed", one.sigma, one.c, Some(one.b))));
        let sigma = (lock.at.sigma - exact.sigma).abs();
        section.budget(
            "lock, measured against the exact orbit",
            format!("{sigma:.1e} in σ, {:.3} % in C", percent(lock.at.c, exact.c)),
            &format!(
                "Standard uncertainties: {:.1e} in σ, {:.1e} in C. The rest of the approach is extrapolated.",
                lock.at.u_sigma, lock.at.u_c
            ),
        );
    }
    if let Some(theory) = &found.theory {
        let (sigma, c, b) = (theory.sigma, theory.c, theory.b);
        rows.push(cells("first-order theory", sigma, c, Some(b)));
    }
    if let (Some(theory), Some(exact)) = (&found.theory, &found.exact) {
        let sigma = (theory.sigma - exact.sigma).abs();
        section.budget(
            "theory against the exact orbit, at the lock",
            format!("{sigma:.3} in σ, {:.1} % in C", percent(theory.c, exact.c)),
            "The theory is of first order in ε; the convergence study below shows that the difference shrinks as ε.",
        );
    }
    section.table(
        "The locked point. σ: detuning, C: amplitude of v over b, B: particle speed over b ω₀.",
        Table::new(" | σ | C | B").rows(rows),
    );
}
