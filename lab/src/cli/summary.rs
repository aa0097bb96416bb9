//! Results in words and tables.

use vines::advice::Reason;
use vines::comparison::{COMPARED_ABOVE, Comparison, TrackedComparison, TrackedPoint};
use vines::fit::{Contradiction, FittedParameter};
use vines::identification::{DecayEnd, Friction, Regime, ResonancePoint};
use vines::numerics::SIGNIFICANT;
use vines::orbit::Orbit;
use vines::regime_map::Map;
use vines::scene::{Definition, Dimensionless, Scene};
use vines::table::{Table, row, with_uncertainty};

/// The dimensionless numbers of a scene, in one line.
pub(super) fn parameters(p: &Dimensionless) -> String {
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

/// Units of the measurements: response at the sensor, m per m of the oscillator's response; drive per m of the oscillator's base; name and unit of both.
pub(super) struct Units {
    pub(super) factors: [f64; 2],
    pub(super) names: [(String, &'static str); 2],
}

impl Units {
    pub(super) fn of(scene: &Scene) -> Self {
        let Some(structure) = &scene.structure else {
            return Self {
                factors: [1.0; 2],
                names: [("response".into(), "m"), ("base".into(), "m")],
            };
        };
        let point = |n: usize| &structure.points[n];
        let drive = structure
            .drive
            .map_or("base".into(), |n| format!("force at {}", point(n)));
        Self {
            factors: [
                structure.reading_per_response().abs(),
                structure.base_per_drive().recip(),
            ],
            names: [
                (format!("response at {}", point(structure.sensor)), "m"),
                (drive, structure.excitation.unit()),
            ],
        }
    }

    /// Frequency in hertz, amplitude of response and drive, with their uncertainties.
    fn values(&self, at: &ResonancePoint) -> [String; 3] {
        let [response, drive] = self.factors;
        let value = |value: f64, u: f64, unit: f64| format!("{:.5e} ± {:.1e}", value * unit, u * unit);
        [
            with_uncertainty(at.f_hz, at.u_f_hz),
            value(at.a_m, at.u_a_m, response),
            value(at.e_m, at.u_e_m, drive),
        ]
    }
}

/// Why a run of the scene did not lock the symmetric 1:1 motion, and what to do.
pub(super) fn not_locked(reason: &Reason, scene: &Scene) -> String {
    let places = |stable: &[Orbit]| {
        let place = |orbit: &Orbit| format!("sigma = {:.4}, C = {:.4}", orbit.sigma, orbit.c);
        let places: Vec<String> = stable.iter().map(place).collect();
        format!(
            "at this G, the stable symmetric 1:1 motion is at {}",
            places.join(" and at ")
        )
    };
    let text = match reason {
        Reason::WrongSign => {
            return "the loop runs away from resonance: its frequency rises while the response lags, or falls while it leads. The sign of the \
                    controller's gain, or of its phase, is wrong"
                .into();
        }
        Reason::HitAtOnce => {
            return "the particle moves at the start and hits before the controller knows the signal, in which an impact is a step or a peak; set \
                    start.dq2 = 0: the search brings impacts about"
                .into();
        }
        Reason::Unstable { g, range } => {
            let range = range.map_or_else(
                || "at no G".into(),
                |[low, high]| {
                    let gaps = if (low..=high).contains(g) { ", with gaps" } else { "" };
                    format!("for G from {low:.3} to {high:.3}{gaps}")
                },
            );
            format!("there is no stable symmetric 1:1 orbit at G = {g:.4}; it is stable {range}")
        }
        Reason::Excluded { stable } => format!(
            "{}, thus at omega = {:.4} omega0, which controller.omega_min = {} and controller.omega_max = {} exclude",
            places(stable),
            stable[0].omega,
            scene.controller.omega_min,
            scene.controller.omega_max
        ),
        Reason::LagsLess { stable } => format!(
            "{}, where under a constant drive the response lags less at a higher frequency: no phase loop holds it. Try another G",
            places(stable)
        ),
        Reason::NoImpacts { stable, onset } => format!(
            "the particle does not reach the walls: under a constant drive, impacts begin at G = {onset:.3}; give it a velocity in [start]; {}",
            places(stable)
        ),
        Reason::Coexists { stable, regime: Regime::Symmetric } => places(stable),
        Reason::Coexists { stable, regime } => format!(
            "the motion is {}, and coexists with the wanted one: {}. Try another G or another [start]",
            regime.name(),
            places(stable)
        ),
    };
    // The exact orbits are those of all modes of a structure; only the onset of impacts is of one oscillator.
    let left_out = match reason {
        Reason::NoImpacts { .. } => scene.left_out(),
        _ => scene.left_out_of_cavity(),
    };
    match left_out {
        Some(left_out) => format!("{text}. This holds for the ideal cavity, without {left_out}"),
        None => text,
    }
}

/// How measured points contradict the scene.
pub(super) fn contradicts(contradiction: &Contradiction) -> String {
    let Contradiction { points, chi_square, degrees, parameters } = contradiction;
    let size = format!("chi-square is {chi_square:.0} for {degrees}");
    let differences = match parameters.as_deref() {
        None if *points < 3 => return format!("the locked point does not belong to this scene ({size})"),
        None => {
            return format!(
                "the points do not belong to this scene ({size}), nor to the ideal cavity with other parameters"
            );
        }
        Some([]) => format!("several parameters differ together ({size})"),
        Some(parameters) => {
            let texts = parameters.iter().map(|parameter| {
                let FittedParameter { symbol, unit, value, uncertainty, expected } = parameter;
                let space = if unit.is_empty() { "" } else { " " };
                format!("{symbol} = {value:.4e} ± {uncertainty:.1e}{space}{unit} fits, the scene says {expected:.4e}")
            });
            texts.collect::<Vec<String>>().join("; ")
        }
    };
    format!("the points do not belong to this scene: {differences}")
}

/// How often each regime occurs on a map.
pub(super) fn regimes(map: &Map) -> Table {
    let inside = map.cells.iter().filter(|cell| cell.theory_stable).count();
    let share = |count: usize, of: usize| match of {
        0 => "-".into(),
        _ => format!("{:.1} %", 100.0 * count as f64 / of as f64),
    };
    let rows = Regime::SIMULATED.into_iter().map(|regime| {
        let (all, stable) = map.count(regime);
        let shares = [share(all, map.cells.len()), share(stable, inside)];
        [vec![regime.name().to_string(), all.to_string()], shares.into()].concat()
    });
    Table::new("regime | cells | share | inside the theory's stable island").rows(rows)
}

/// What the symbols of an identification mean.
const SYMBOLS: &str = "  sigma: detuning (omega/omega0 - 1)/epsilon; C: amplitude of the response over b; B: particle speed over b omega0; G: base amplitude \
                       over b epsilon\n";

/// An identification: the locked point beside theory and exact orbit, then the decay.
pub(super) fn identification(result: &Comparison, scene: &Scene) -> String {
    let (lock, at) = (&result.lock, &result.lock.at);
    let units = Units::of(scene);
    let [hertz, response, drive] = units.values(at);
    let [(of_response, m), (of_drive, unit)] = units.names;
    let b = lock.b.zip(lock.u_b).map_or("-".into(), |(b, u)| with_uncertainty(b, u));
    let [sigma, c] = [(at.sigma, at.u_sigma), (at.c, at.u_c)].map(|(value, u)| with_uncertainty(value, u));
    let g = with_uncertainty(at.g, at.u_g);
    let measured = ["measured at the lock".to_string(), sigma, c, b];
    let exact = result.exact.map(|orbit| {
        let Orbit { sigma, c, b, .. } = orbit;
        row("exact orbit", [sigma, c, b])
    });
    let name = match result.curve.is_of_structure {
        true => "driven mode alone, first order",
        false => "theory, first order",
    };
    let theory = result.theory.map(|point| row(name, [point.sigma, point.c, point.b]));
    let table = Table::new(" | sigma | C | B").rows([measured]).rows(exact).rows(theory);
    let behind_shaker = scene
        .structure
        .as_ref()
        .is_some_and(|structure| structure.shaker.is_some());
    let held = match lock.held {
        // A constant command is no constant force.
        true if behind_shaker => " (the response is held by control, as always behind a shaker)",
        true => " (the response is held by control: a constant drive holds it hardly, or not)",
        false => "",
    };
    let mut text = format!(
        "Measured: {hertz} Hz, {of_response} {response} {m}, {of_drive} {drive} {unit}\n{}, G = {}\nLocked after {:.0} periods{held}: {}, {}, phase error {:.1e} ± {:.1e} degrees\n\n{}",
        rig(&result.parameters),
        g,
        lock.periods_to_lock,
        lock.regime,
        lock.impacts(),
        at.phase_error_deg,
        at.u_phase_deg,
        table.text(),
    );
    text += SYMBOLS;
    if let Some(Orbit { g, .. }) = result.exact {
        text += &format!(
            "  (the exact orbit has the measured C, and the drive G = {g:.6}; theory is at the requested G)\n"
        );
    }
    let mut note = |note: &str| text += &format!("  ({note})\n");
    note(&format!(
        "stability: over {} periods a disturbance would show that grows by {:.1} % per period or more; slower growth is not excluded",
        lock.averaged,
        100.0 * lock.unseen_growth
    ));
    if let Some(friction) = lock.friction {
        note(&friction_text(&friction));
    }
    if let Some(share) = lock.clipped_percent {
        note(&format!(
            "before the release the amplifier was at its limit in {share:.1} % of the samples"
        ));
    }
    if let Some(left_out) = &result.left_out {
        note(&ideal("theory and exact orbits are", left_out));
    }
    if result.exact.is_none() && result.theory.is_none() {
        note("theory and exact orbits are for phase resonance, -90 degrees; there is none to compare with");
    }
    if let Some(tone) = lock.tone {
        note(&format!(
            "{tone}: more than the particle can cause, so it is no part of the motion; check the cable of the sensor"
        ));
    }
    let smallest = result.curve.places().iter().map(|[_, _, g, _]| *g).reduce(f64::min);
    if let Some(smallest) = smallest.filter(|g| (at.g - g).abs() < SIGNIFICANT * at.u_g) {
        note(&format!(
            "the drive lies at the fold within its uncertainty: the smallest of the exact backbone is G = {smallest:.6}"
        ));
    }
    let asked = result.parameters.g;
    if (at.g - asked).abs() > SIGNIFICANT * at.u_g {
        note(&format!("G = {asked} was asked for"));
    }
    if result.exact.is_none() && !result.orbits.is_empty() {
        note("no exact orbit has the measured C");
    }
    for orbit in result.others() {
        note(&format!(
            "another stable orbit at this G, not followed: sigma = {:.4}, C = {:.4}, B = {:.4}",
            orbit.sigma, orbit.c, orbit.b
        ));
    }
    if result.exact.as_ref().is_some_and(Orbit::is_unstable) {
        note("the exact orbit is unstable under a constant drive and frequency; the loop holds it");
    }
    format!("{text}\n{}\n{}\n", decay(result), agreement(result))
}

/// That `results` of the ideal cavity leave something out.
pub(super) fn ideal(results: &str, left_out: &str) -> String {
    format!("{results} of the ideal cavity, without {left_out}")
}

/// Whose numbers the results of a structure are, as a line; empty for one oscillator.
pub(super) fn structure(scene: &Scene) -> String {
    let Some(structure) = &scene.structure else {
        return String::new();
    };
    let masses = structure.mass_loading();
    let masses = masses.map_or(String::new(), |text| format!("{text}; all modes here are with them\n"));
    format!(
        "{masses}epsilon, lambda, sigma, C and G are those of mode {}, as are A_m and E_m in files: {:.5e} m and {:.5e} m per unit of response and drive\n",
        structure.driven + 1,
        structure.reading_per_response().abs().recip(),
        structure.base_per_drive()
    )
}

/// In what the result is not the requested one.
pub(super) fn not_as_asked(result: &Comparison, scene: &Scene) -> impl Iterator<Item = String> {
    let lock = &result.lock;
    let Units { factors: [_, factor], names: [_, (of_drive, unit)] } = Units::of(scene);
    let ratio = lock.at.e_m / lock.requested_e_m;
    let another = (!lock.at_requested_drive).then(|| {
        format!(
            "the result is at another drive than the requested one: {of_drive} {:.5e} ± {:.1e} {unit}, {ratio:.4} times the requested {:.5e} {unit}",
            lock.at.e_m * factor,
            lock.at.u_e_m * factor,
            lock.requested_e_m * factor
        )
    });
    let moves = result.base_after_release.map(|[base, u]| {
        format!(
            "there is no free decay: the drive was released, but the {of_drive} goes on with the drive's frequency, with at least {:.2e} ± {:.1e} {unit}, \
             {:.1e} times the requested drive",
            base * factor,
            u * factor,
            base / lock.requested_e_m
        )
    });
    [another, moves].into_iter().flatten()
}

/// What friction did, as a sentence.
pub(super) fn friction_text(friction: &Friction) -> String {
    let Friction { sticks_per_period, stuck_time, loss } = friction;
    let sticking = if *sticks_per_period > 0.0 {
        format!("stuck to the floor {sticks_per_period:.3} times, for {stuck_time:.3e} s in all")
    } else {
        "never stuck to the floor".into()
    };
    format!("per period of the hold, friction took {loss:.3e} J, and the particle {sticking}")
}

fn decay(result: &Comparison) -> String {
    let end = match result.decay_end {
        DecayEnd::Synchrony => "where the impacts lose synchrony",
        DecayEnd::Linear => "where the impacts end",
        DecayEnd::Record => "where the record ends; a larger record.decay_periods shows more",
        DecayEnd::Driven => return "Free decay: no points, because the base goes on moving after the release".into(),
        DecayEnd::OtherMode => {
            return "Free decay: no points, because another mode moves freely after the release, too near the driven one to be told apart. Behind a \
                    shaker, short its coil (amplifier = \"voltage\"), or cut the stinger (release = \"cut\")"
                .into();
        }
    };
    match &result.decay[..] {
        [] => format!("Free decay: no points, because it is shorter than the window of the fit; it ends {end}"),
        points @ [first, ..] => format!(
            "Free decay: {} points from C = {:.4} down to {:.4}, {end}",
            points.len(),
            first.point.c,
            points[points.len() - 1].point.c
        ),
    }
}

fn agreement(result: &Comparison) -> String {
    let Some(rms) = result.rms_sigma_error else {
        return format!("No point of the decay lies above C = {COMPARED_ABOVE}");
    };
    let exact = result.rms_sigma_exact.zip(result.rms_sigma_predicted);
    let exact = exact.map_or(String::new(), |(raw, predicted)| {
        format!("\nRMS of sigma against the exact backbone: {raw:.4}; against the decay that the exact plant predicts: {predicted:.4}")
    });
    let theory = match result.curve.is_of_structure {
        true => "theory of the driven mode alone",
        false => "theory",
    };
    format!(
        "RMS of sigma against {theory} over C > {COMPARED_ABOVE}: {rms:.4} (theory is of first order in epsilon){exact}"
    )
}

/// The points of a tracked backbone, and the periods that they took. A rig that does not report impacts has columns in SI units.
pub(super) fn tracked(result: &TrackedComparison, scene: &Scene) -> String {
    let (points, units) = (|| result.points.iter(), Units::of(scene));
    let is_symmetric = scene.knowledge().is_symmetric;
    let in_metres = points().all(|compared| compared.point.regime_by_impacts.is_none());
    let rows = points().map(|TrackedPoint { point, exact }| {
        let at = &point.at;
        let mut remarks = point.regime.to_string();
        if let Some(by_impacts) = point.regime_by_impacts {
            remarks += &format!(" / {by_impacts}");
        }
        if let Some(why) = point.unsettled(is_symmetric) {
            remarks += &format!("; not settled: {why}");
        }
        if let Some(tone) = point.tone {
            remarks += &format!("; {tone}");
        }
        let si = in_metres.then(|| units.values(at)).into_iter().flatten();
        let pairs = [(at.c, at.u_c), (at.sigma, at.u_sigma), (at.g, at.u_g)];
        let pairs = pairs.map(|(value, u)| with_uncertainty(value, u));
        let error = exact.and_then(|exact| Some(exact.sigma?.abs().max(exact.g?.abs())));
        let others = [
            format!("{:+.2}°", at.phase_error_deg),
            format!("{:.1}", point.periods),
            point.averaged.to_string(),
            error.map_or("-".into(), |error| format!("{error:.1e}")),
            remarks,
        ];
        si.chain(pairs).chain(others).collect::<Vec<_>>()
    });
    let si = match in_metres {
        true => {
            let [response, drive] = units.names.each_ref().map(|(name, unit)| format!("{name}, {unit}"));
            format!("frequency, Hz | {response} | {drive} | ")
        }
        false => String::new(),
    };
    let headings = "C | sigma | G | off target | periods | averaged | error | regime by response / by impacts";
    let table = Table::new(&format!("{si}{headings}")).rows(rows);
    let mut worst = result.worst().map_or(String::new(), |worst| {
        format!(
            "Largest error of a settled point, in sigma or G against the exact backbone at the same C: {:.1e} (distance from the nearest \
             place of the curve: {:.1e})\n",
            worst.at_equal_c, worst.nearest
        )
    });
    let rows = points().filter_map(|compared| {
        let point = &compared.point;
        let harmonics = point
            .drive_harmonics?
            .map(|harmonic| format!("{:.3}", 100.0 * harmonic));
        let clipped = point.clipped_percent.map(|share| format!("{share:.1}"));
        let numbers = [format!("{:.4}", point.at.c)].into_iter().chain(harmonics);
        Some(numbers.chain(clipped).collect::<Vec<_>>())
    });
    let harmonics = Table::new("C | 2, % | 3, % | 4, % | 5, % | 6, % | 7, % | clipped, %").rows(rows);
    if !harmonics.is_empty() {
        let [_, (drive, _)] = &units.names;
        worst += &format!(
            "Harmonics of the {drive}, as measured, over its first, and share of the samples with the amplifier at its limit\n{}",
            harmonics.text()
        );
    }
    let hidden = points().map(|compared| &compared.point).filter(|point| {
        let regimes = (point.regime, point.regime_by_impacts);
        point.settled && regimes == (Regime::Symmetric, Some(Regime::Asymmetric))
    });
    let hidden = hidden.count();
    if hidden > 0 {
        worst += &format!(
            "Settled points whose response looks symmetric, but whose impacts are asymmetric (not the symmetric backbone): {hidden}\n"
        );
    }
    if let Some([u_sigma, u_lambda]) = result.u_linear {
        let measured = format!(
            "The exact backbone has the measured damping, lambda = {:.3} ± {u_lambda:.3}; all sigma share ± {u_sigma:.3}, from the measured natural \
             frequency",
            result.parameters.lambda
        );
        worst += &match result.unexplained() {
            0 => format!("{measured}.\nThey explain the distance of all settled points (95 %)\n"),
            count => format!("{measured}.\nThey do not explain the distance of {count} settled points (95 %)\n"),
        };
    }
    if let Some(left_out) = &result.left_out {
        worst += &format!("({})\n", ideal("the exact backbone is", left_out));
    }
    format!(
        "{}\n\n{}\n{} points in {:.0} periods, {:.1} of which before the loop held the response: {:.1} periods per point\n{worst}",
        rig(&result.parameters),
        table.text(),
        result.points.len(),
        result.periods,
        result.periods_to_lock,
        result.periods_per_point()
    )
}
