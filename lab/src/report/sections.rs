//! The sections of the report: each computes its results, describes them, and adds its figures, tables and lines of the error budget.

use std::error::Error;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::figures;
use super::files::{ReportError, bifurcations_csv, csv, decay_csv, json, map_csv, tracked_csv};
use super::table::{Table, number, with_uncertainty};
use super::{Section, summary};
use crate::backbone::track;
use crate::comparison::{COMPARED_ABOVE, Comparison, TrackedComparison, TrackedPoint};
use crate::experiment;
use crate::identification::{DecayEnd, identify};
use crate::orbit::{
    Branch, Condition, ContinuationLimits, DOUBLINGS, FrequencyResponse, ImpactPattern, Periodic, backbone,
    convergence, response, stable_resonant,
};
use crate::record::Record;
use crate::regime::Regime;
use crate::rig::{BuiltIn, Simulated};
use crate::scene::Dimensionless;
use crate::sweep::{Axis, Map};
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow, resonant};

/// Gets the fraction of a section that is done, from 0 to 1.
type Progress<'a> = &'a (dyn Fn(f64) + Sync);

/// Computes one section.
type Maker = fn(&mut Map, Progress) -> Result<Section, ReportError>;

/// All sections in order, with the names that the progress bar shows.
pub(super) const SECTIONS: [(&str, Maker); 5] = [
    ("experiment", experiment),
    ("tracking", tracking),
    ("theory", theory),
    ("curves", curves),
    ("regimes", regimes),
];

/// Lock, hold, release, decay.
fn experiment(map: &mut Map, _: Progress) -> Result<Section, ReportError> {
    let mut section = Section::new("The experiment");
    let scene = map.sweep.scene();
    let mut rig = Simulated::of(scene)?;
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let mut measure = || -> Result<(Record, Comparison), Box<dyn Error>> {
        let record = experiment::run(rig.as_mut(), &mut controller, scene, |_, _, _| {})?;
        let identification = identify(&record, scene)?;
        Ok((record, Comparison::of(&identification, scene)))
    };
    let (record, result) = match measure() {
        Ok(measured) => measured,
        Err(error) => return Ok(section.concluded(format!("The experiment gave no backbone: {error}."))),
    };
    describe(&mut section, &result);
    section.figure(
        "history",
        "Amplitude and frequency over time. Left: the loop searches for phase resonance and holds it; measured once per period. Right: \
         the drive is off, and the motion decays along the backbone until the impacts lose synchrony at the fold. \
         Times are in periods 2π/ω₀ of the oscillator alone.",
        &figures::history(&record, scene, &result),
    );
    section.figure(
        "decay-on-sim",
        "The decay on the slow invariant manifold (axes of the study: amplitude over particle speed), from the locked point (square) down \
         the right branch to its fold.",
        &figures::manifold(&result),
    );
    section.figure(
        "identified-backbone",
        "The identified backbone: points along the decay (circles), the locked point (square), the exact curve and first-order theory. \
         Uncertainties of the locked point are drawn where they are longer than its mark.",
        &figures::backbone(&result),
    );
    section.attach("backbone.csv", decay_csv(&result)?);
    section.attach("identification.json", json(&result)?);
    Ok(section)
}

fn describe(section: &mut Section, result: &Comparison) {
    let (lock, target) = (&result.lock, result.phase_target_deg);
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
    describe_lock(section, result);
    if let (Some(first), Some(last)) = (result.decay.first(), result.decay.last()) {
        section.words(format!(
            "Then the drive was switched off. The motion decayed from C = {:.4} to C = {:.4} ({} ended the points). \
             During the decay it moved along the backbone, and {} points of the backbone were identified.",
            first.point.c,
            last.point.c,
            match result.decay_end {
                DecayEnd::Synchrony => "the loss of synchrony",
                DecayEnd::Linear => "the end of the impacts",
                DecayEnd::Record => "the end of the record",
            },
            result.decay.len()
        ));
    }
    if let Some((raw, predicted)) = result.rms_sigma_exact.zip(result.rms_sigma_predicted) {
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
    if let Some(rms) = result.rms_sigma_error {
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

/// The locked point beside exact orbit and theory: a row for each quantity, dimensionless and in SI units.
fn describe_lock(section: &mut Section, result: &Comparison) {
    let (p, lock, at) = (&result.parameters, &result.lock, &result.lock.at);
    let millimetres = 1e3 * at.a_m / at.c;
    let measured = [
        (at.sigma, at.u_sigma),
        (at.f_hz, at.u_f_hz),
        (at.c, at.u_c),
        (1e3 * at.a_m, 1e3 * at.u_a_m),
        lock.b.zip(lock.u_b).unwrap_or((f64::NAN, f64::NAN)),
    ];
    let measured = measured.map(|(value, u)| match value.is_nan() {
        true => "–".into(),
        false => with_uncertainty(value, u),
    });
    let mut columns = vec![("measured", measured)];
    let mut add = |name, [sigma, c, b]: [f64; 3]| {
        let numbers = [sigma, p.omega(sigma) / TAU, c, millimetres * c, b];
        columns.push((name, numbers.map(number)));
    };
    let percent = |c: f64, reference: f64| 100.0 * (c / reference - 1.0).abs();
    if let Some(exact) = &result.exact {
        add("exact orbit", [exact.sigma, exact.c, exact.b]);
        for orbit in result.others() {
            add("another stable orbit, not followed", [orbit.sigma, orbit.c, orbit.b]);
        }
        let sigma = (at.sigma - exact.sigma).abs();
        section.budget(
            "lock, measured against the exact orbit",
            format!("{sigma:.1e} in σ, {:.3} % in C", percent(at.c, exact.c)),
            &format!(
                "Standard uncertainties: {:.1e} in σ, {:.1e} in C. The rest of the approach is extrapolated.",
                at.u_sigma, at.u_c
            ),
        );
    }
    if let Some(theory) = &result.theory {
        add("first-order theory", [theory.sigma, theory.c, theory.b]);
    }
    if let Some((theory, exact)) = result.theory.zip(result.exact) {
        let sigma = (theory.sigma - exact.sigma).abs();
        section.budget(
            "theory against the exact orbit, at the lock",
            format!("{sigma:.3} in σ, {:.1} % in C", percent(theory.c, exact.c)),
            "The theory is of first order in ε; the convergence study below shows that the difference shrinks as ε.",
        );
    }
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let quantities = [
        "detuning σ",
        "frequency, Hz",
        "amplitude C",
        "amplitude, mm",
        "particle speed B",
    ];
    let rows = quantities.iter().enumerate().map(|(n, quantity)| {
        let cells = columns.iter().map(|(_, cells)| cells[n].clone());
        std::iter::once(quantity.to_string()).chain(cells).collect::<Vec<_>>()
    });
    section.table(
        "The locked point. σ = (ω/ω₀ − 1)/ε; C: amplitude of the response over b; B: particle speed over b ω₀. Numbers after ± are \
         standard uncertainties.",
        &Table::new(&format!(" | {}", names.join(" | "))).rows(rows),
    );
    if let Some(friction) = &lock.friction {
        section.words(format!("Friction: {}.", summary::friction_text(friction)));
    }
}

/// The backbone tracked with the loop closed, level by level.
fn tracking(map: &mut Map, done: Progress) -> Result<Section, ReportError> {
    let mut section = Section::new("The backbone, tracked with the loop closed");
    let scene = map.sweep.scene();
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let mut rig = Simulated::of(scene)?;
    let tracked = track(rig.as_mut(), &mut controller, scene, |at, of| {
        done(at as f64 / of.max(1) as f64);
    });
    let tracked = match tracked {
        Ok(tracked) if !tracked.points.is_empty() => TrackedComparison::of(&tracked, scene),
        Ok(_) => return Ok(section.concluded("Tracking gave no point.")),
        Err(error) => return Ok(section.concluded(format!("Tracking gave no backbone: {error}."))),
    };
    let symmetric = |tracked: &&TrackedPoint| tracked.point.regime_by_impacts == Some(Regime::Symmetric);
    let in_regime = tracked.points.iter().filter(symmetric).count();
    section.finding = format!(
        "Tracked with the loop closed, the backbone took {} points in {:.0} periods, {:.1} a point.",
        tracked.points.len(),
        tracked.periods,
        tracked.periods_per_point()
    );
    section.words(format!(
        "A decay is not a steady motion, so its points lie off the backbone. Here the loop holds the response at one level after \
         another until it has settled, and the amplitude of the drive follows. {} Of these points, {in_regime} are in the symmetric 1:1 regime.",
        section.finding
    ));
    section.figure(
        "tracked-backbone",
        "The backbone tracked with the loop closed, the exact curve and first-order theory.",
        &figures::tracked(&tracked),
    );
    if let Some(worst) = tracked.worst() {
        section.budget(
            "tracked backbone against the exact one",
            format!("at most {:.1e} in σ and G", worst.at_equal_c),
            "Largest difference from the exact curve at the same C, over all settled points.",
        );
    }
    section.attach("tracked.csv", tracked_csv(&tracked)?);
    Ok(section)
}

/// First-order theory: the backbones of several r, activation, and how it approaches the exact orbits.
fn theory(map: &mut Map, _: Progress) -> Result<Section, ReportError> {
    let mut section = Section::new("First-order theory and its accuracy");
    let p = map.sweep.scene().dimensionless();
    let flow = SlowFlow::new(p.lambda, p.r);
    let stable = resonant(&p).into_iter().find(|point| point.stable());
    section.words(format!(
        "In the theory, the motions lie on the slow invariant manifold C² = R²B² + (1 − πB/2)², R = (1 − r)/(1 + r). Its fold is at \
         C = {:.4}, B = {:.4}. Two symmetric impacts per period are stable from there to B = {B_SYMMETRY_BREAKING:.4}, for every r. \
         docs/theory.md has the derivation and notes two misprints of the published study.",
        flow.manifold.c_min(),
        flow.manifold.b_min()
    ));
    describe_activation(&mut section, &p, stable.map_or(0.0, |point| point.sigma));
    if let Some(point) = &stable {
        section.figure(
            "approach",
            "The modulation off the manifold by the theory, one dot per impact. Driven at phase resonance, motions that start off the \
             manifold reach it within a few impacts and move along it to the locked point (square). Without drive, the motion moves \
             down to the fold and loses its synchrony there. It lies a little below the manifold, as the measured decay does: the \
             drift along the manifold is not infinitely slow compared with the approach to it.",
            &figures::approach(&p, point),
        );
    }
    section.figure(
        "backbones",
        "Backbones of first-order theory. Their shape does not depend on λ, but their stability does. The smaller the loss at the \
         impacts, the lower the amplitude at the fold.",
        &figures::theory(&p),
    );
    let Some(study) = convergence(&p, 6) else {
        return Ok(section.concluded("Theory and exact orbits have no common stable phase-resonant motion here."));
    };
    let [s, c, b] = study.slopes;
    let finding = format!(
        "The difference between first-order theory and exact orbit shrinks as ε to the power {s:.2} in σ, {c:.2} in C and {b:.2} in B."
    );
    let rows = study.rows.iter();
    let rows = rows.map(|row| [row.epsilon, row.sigma, row.c, row.b].map(|value| format!("{value:.3e}")));
    section.table(
        "Theory minus exact orbit at phase resonance; λ, r and G as in the scene.",
        &Table::new("ε | in σ | in C | in B").rows(rows),
    );
    section.attach("convergence.csv", csv("", &study.rows)?);
    Ok(section.concluded(finding))
}

fn describe_activation(section: &mut Section, scene: &Dimensionless, sigma: f64) {
    let activation = SlowFlow::new(scene.lambda, scene.r).activation(scene.epsilon, sigma);
    let stable = activation.stable.map_or("exists at no G".into(), |g| {
        format!("needs less, G = {g:.4}, but only a particle that is already moving reaches it")
    });
    section.words(format!(
        "How much base motion is needed? At σ = {sigma:.4}, the steady linear response reaches the wall at G = {:.4}. When the drive is \
         switched on at rest, the first beat is larger than that: impacts start at G = {:.4}, or at G = {:.4} with the phase of the base \
         that needs the least. A stable 1:1 motion {stable}.",
        activation.steady_linear, activation.from_rest, activation.from_rest_any_phase
    ));
}

/// Exact frequency responses and backbone, and one period of the locked motion.
fn curves(map: &mut Map, done: Progress) -> Result<Section, ReportError> {
    let mut section = Section::new("Exact periodic motions");
    let p = map.sweep.scene().dimensionless();
    let limits = ContinuationLimits::default();
    let excitations = excitations(&p);
    let mut responses: Vec<FrequencyResponse> = Vec::new();
    for (n, g) in excitations.iter().enumerate() {
        responses.push(response(&Dimensionless { g: *g, ..p }, &limits, DOUBLINGS));
        done((n + 1) as f64 / (excitations.len() + 1) as f64);
    }
    let Some(curve) = backbone(&p, &limits) else {
        return Ok(section.concluded("There is no exact phase-resonant 1:1 motion at this excitation."));
    };
    describe_backbone(&mut section, &curve);
    if let Some(response) = responses.iter().find(|response| response.g == p.g) {
        section.figure(
            "responses",
            "The frequency response: exact, first-order, and the exact backbone near its maximum. \
             Where a response loses its symmetry, the asymmetric motions (blue, beside the dashed curve) take over.",
            &figures::responses(&p, response, [-5.0, 5.0]),
        );
    }
    let changes = changes(&responses);
    if !changes.is_empty() {
        section.table(
            "Where the symmetric motions on the exact frequency responses change stability.",
            &changes,
        );
    }
    if let Some(motion) = locked(&p) {
        let flow = SlowFlow::new(p.lambda, p.r);
        let theory = flow.phase_resonant(p.g);
        let theory = theory.iter().find(|point| point.stable());
        section.figure(
            "period",
            "One period of the locked motion. Above: the primary mass with its walls, and the particle between them; circles \
             mark the impacts. Below: centre of mass and relative displacement, exact and by first-order theory.",
            &figures::period(&p, &motion, theory),
        );
    }
    section.attach("curves.csv", curves_csv(&curve, &responses)?);
    Ok(section)
}

fn describe_backbone(section: &mut Section, curve: &Branch) {
    let special = curve.special.iter().map(|special| {
        let Periodic { sigma, c, g, .. } = special.motion;
        format!("{} at σ = {sigma:.4}, C = {c:.4}, G = {g:.4}", special.name())
    });
    let special: Vec<String> = special.collect();
    section.finding = format!(
        "The exact backbone was followed through {} motions; its stability changes in {} place{}.",
        curve.points.len(),
        special.len(),
        if special.len() == 1 { "" } else { "s" }
    );
    section.words(
        "These motions are exact: periodic orbits of the full equations, found by shooting on the impact map. Pseudo-arclength \
         continuation follows them through folds and symmetry breaking, stable or not. There is no first-order approximation.",
    );
    let places = if special.is_empty() {
        "nowhere".into()
    } else {
        special.join("; ")
    };
    section.words(format!(
        "Along the exact backbone, stability changes here: {places}. The theory predicts symmetry breaking at \
         B = {B_SYMMETRY_BREAKING:.4} for every r."
    ));
}

/// Where stability changes on the responses.
fn changes(responses: &[FrequencyResponse]) -> Table {
    let rows = responses.iter().flat_map(|response| {
        let changes = response.symmetric().flat_map(|branch| &branch.special);
        changes.map(|special| {
            let Periodic { sigma, c, b, .. } = special.motion;
            let [sigma, c, b] = [sigma, c, b].map(|value| format!("{value:.5}"));
            [format!("{:.4}", response.g), special.name().into(), sigma, c, b]
        })
    });
    Table::new("G | what | σ | C | B").rows(rows)
}

/// The stable resonant motion at the scene's excitation.
fn locked(p: &Dimensionless) -> Option<Periodic> {
    let orbit = stable_resonant(p)?;
    let conditions = [Condition::Excitation(p.g), Condition::backbone(p)];
    Periodic::find(p, &ImpactPattern::symmetric(), &orbit.unknowns(), conditions)
}

/// The scene's excitation, and others from just above the onset of stable motions to beyond symmetry breaking.
fn excitations(p: &Dimensionless) -> Vec<f64> {
    let flow = SlowFlow::new(p.lambda, p.r);
    let breaking = flow.backbone_at(B_SYMMETRY_BREAKING).g;
    let mut list = vec![p.g, 1.12 * breaking];
    if p.g < 0.85 * breaking {
        list.push(0.5 * (p.g + breaking));
    }
    list.sort_by(f64::total_cmp);
    list.dedup_by(|g, before| (*g - *before).abs() < 0.03 * breaking);
    list
}

/// The orbits of all curves, as CSV.
fn curves_csv(backbone: &Branch, responses: &[FrequencyResponse]) -> Result<String, ReportError> {
    let headings = "curve,sigma,G,C,gamma,B,largest_multiplier,stable";
    let components = responses.iter().flat_map(|response| {
        let name = |name: &str| format!("G={:.4}: {name}", response.g);
        response
            .components
            .iter()
            .map(move |component| (name(&component.name), &component.branch))
    });
    let curves = std::iter::once(("backbone".to_string(), backbone)).chain(components);
    let rows = curves.flat_map(|(curve, branch)| {
        branch.points.iter().map(move |motion| {
            let Periodic { sigma, g, c, gamma, b, stable, .. } = *motion;
            (curve.clone(), sigma, g, c, gamma, b, motion.moduli()[3], stable)
        })
    });
    csv(headings, rows)
}

/// The regime map.
fn regimes(map: &mut Map, done: Progress) -> Result<Section, ReportError> {
    let mut section = Section::new("Regimes of the driven response");
    let (count, all) = (AtomicUsize::new(0), map.sweep.cells());
    map.run(0, || {
        let n = count.fetch_add(1, Ordering::Relaxed) + 1;
        done(n as f64 / all as f64);
    })?;
    describe_map(&mut section, map);
    section.figure(
        "regimes",
        "The regime map. The black line is the border of the island in which first-order theory has a stable symmetric 1:1 motion. The \
         coloured curves are exact bifurcations of the 1:1 motions, solid where they bound the stability of one.",
        &figures::regimes(map),
    );
    section.budget(
        "regime map",
        "one start per cell".into(),
        "Where several regimes are stable, the start decides. Chaos that ends only after more periods than were simulated counts \
         as lasting; docs/regimes.md says how often that happens.",
    );
    section.attach("regimes.csv", map_csv(map)?);
    section.attach("bifurcations.csv", bifurcations_csv(map)?);
    Ok(section)
}

fn describe_map(section: &mut Section, map: &Map) {
    let [x, y] = map.axes().map(Axis::short_form);
    let limit = map.sweep.settings().periods;
    let all = map.cells.len();
    let inside = map.cells.iter().filter(|cell| cell.theory_stable).count();
    let (_, agree) = map.count(Regime::Symmetric);
    let percent = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
    section.finding = format!(
        "Of {all} cells of the map, {inside} lie where the theory has a stable symmetric 1:1 motion; {:.0} % of these show it.",
        percent(agree, inside)
    );
    section.words(format!(
        "Each cell of the map over {x} and {y} is one plant, driven from the scene's start at a fixed frequency until it repeats itself, \
         at most for {limit} periods. A motion that has not repeated itself by then is chaotic if its largest Lyapunov exponent exceeds zero by \
         four standard errors, modulated if also a fifth of its impacts or more are captured into 1:1 resonance for a while, \
         quasi-periodic if the exponent is zero within its uncertainty, and otherwise undecided."
    ));
    section.table("How often each regime occurs.", &summary::regimes(map));
    section.words(section.finding.clone());
}
