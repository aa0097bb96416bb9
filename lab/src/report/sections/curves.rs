//! Exact frequency responses and backbone, and one period of the locked motion.

use crate::orbit::{
    Branch, Component, Condition, ContinuationLimits, DOUBLINGS, FrequencyResponse, ImpactPattern, Periodic, backbone,
    response, stable_resonant,
};
use crate::report::figures::{period, responses};
use crate::report::files::{ReportError, csv};
use crate::report::section::{Section, Subject};
use crate::report::table::Table;
use crate::scene::Dimensionless;
use crate::theory::{B_SYMMETRY_BREAKING, SlowFlow};

pub(super) fn make(subject: &Subject, done: &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError> {
    let mut section = Section::new("Exact periodic motions");
    let p = subject.scene.dimensionless();
    let limits = ContinuationLimits::default();
    let excitations = excitations(&p);
    let mut found: Vec<FrequencyResponse> = Vec::new();
    for (n, g) in excitations.iter().enumerate() {
        found.push(response(&Dimensionless { g: *g, ..p }, &limits, DOUBLINGS));
        done((n + 1) as f64 / (excitations.len() + 1) as f64);
    }
    let Some(curve) = backbone(&p, &limits) else {
        section.found("There is no exact phase-resonant 1:1 motion at this excitation.");
        return Ok(section);
    };
    describe_backbone(&mut section, &curve);
    if found.iter().any(|one| !one.components.is_empty()) {
        section.figure(
            "responses",
            "Frequency responses at several excitations: exact, first-order, and the backbone of the theory near their maxima. \
             Where a response loses its symmetry, the asymmetric motions (blue, beside the dashed curve) take over.",
            responses::figure(&p, &found).svg()?,
        );
    }
    let changes = changes(&found);
    if !changes.is_empty() {
        section.table(
            "Where the symmetric motions on the exact frequency responses change stability.",
            changes,
        );
    }
    if let Some(motion) = locked(&p) {
        let flow = SlowFlow::new(p.lambda, p.r);
        let theory = flow.phase_resonant(p.g);
        let theory = theory.iter().find(|one| one.stable());
        section.figure(
            "period",
            "One period of the locked motion. Above: the primary mass with its walls, and the particle between them; circles \
             mark the impacts. Below: centre of mass and relative displacement, exact and by first-order theory.",
            period::figure(&p, &motion, theory).svg()?,
        );
    }
    section.attach("curves.csv", table(&curve, &found)?);
    Ok(section)
}

fn describe_backbone(section: &mut Section, curve: &Branch) {
    let special: Vec<String> = curve
        .special
        .iter()
        .map(|one| {
            let Periodic { sigma, c, g, .. } = one.motion;
            format!("{} at σ = {sigma:.4}, C = {c:.4}, G = {g:.4}", one.name())
        })
        .collect();
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
    let places = match special.len() {
        0 => "nowhere".into(),
        _ => special.join("; "),
    };
    section.words(format!(
        "Along the exact backbone, stability changes here: {places}. The theory predicts symmetry breaking at \
         B = {B_SYMMETRY_BREAKING:.4} for every r."
    ));
}

/// Where stability changes on the responses.
fn changes(found: &[FrequencyResponse]) -> Table {
    let all = found.iter().flat_map(|one| {
        one.symmetric()
            .flat_map(|branch| &branch.special)
            .map(|special| (one.g, special))
    });
    Table::new("G | what | σ | C | B").rows(all.map(|(g, special)| {
        let Periodic { sigma, c, b, .. } = special.motion;
        let mut cells = vec![format!("{g:.4}"), special.name().into()];
        cells.extend([sigma, c, b].map(|one| format!("{one:.5}")));
        cells
    }))
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
    list.dedup_by(|one, other| (*one - *other).abs() < 0.03 * breaking);
    list
}

/// The orbits of all curves, as CSV.
fn table(backbone: &Branch, responses: &[FrequencyResponse]) -> Result<String, ReportError> {
    let headings = ["curve", "sigma", "G", "C", "gamma", "B", "largest_multiplier", "stable"];
    let components = responses.iter().flat_map(|response| {
        let name = |one: &Component| format!("G={:.4}: {}", response.g, one.name);
        response.components.iter().map(move |one| (name(one), &one.branch))
    });
    let curves = std::iter::once(("backbone".to_string(), backbone)).chain(components);
    let rows = curves.flat_map(|(curve, branch)| {
        let row = move |one: &Periodic| {
            let Periodic { sigma, g, c, gamma, b, stable, .. } = *one;
            (curve.clone(), sigma, g, c, gamma, b, one.moduli()[3], stable)
        };
        branch.points.iter().map(row)
    });
    csv(&headings, rows)
}
