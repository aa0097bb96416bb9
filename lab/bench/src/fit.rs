//! Parameters of a rig from what was measured on it, points of its backbone and recordings: all hypotheses side by side
//! ([`vines_identify::Hypotheses`]), and what their numbers are for programs.

mod channels;
mod recording;

use std::error::Error;
use std::f64::consts::TAU;

use lovines::Cavity;
use serde::Serialize;
use vines_identify::{ChannelTest, Data, EXCLUDED, Fit, Hypotheses, probability};
pub use vines_identify::{FitError, Hypothesis, Known, MeasuredPoint, Quantity};
use vines_model::numerics::{Estimate, SIGNIFICANT};
use vines_model::{ArgumentError, Definition};
use vines_scene::linear::{MeasuredLinear, ParticleState};
pub use vines_scene::scene::table::{Channel, Contents, plain_table};
use vines_scene::scene::{Parameters, Scene, Units};

use crate::identification::ResonancePoint;

pub use channels::Selection;
pub use recording::{Recording, Stretch, decay_in_words};

/// Standard uncertainty of the gain of a reference that was calibrated as usual, relative.
pub const CALIBRATION: f64 = 0.01;
/// Probability of a larger rise of chi-square below which a state of the particle does not agree with a linear response.
const DISAGREES: f64 = 0.01;

impl ResonancePoint {
    /// The point, which was measured in these units, in metres of the oscillator.
    pub fn measured(&self, units: &Units) -> MeasuredPoint {
        let estimate = |value, uncertainty| Estimate { value, uncertainty };
        let measured = MeasuredPoint {
            response: estimate(self.a_m, self.u_a_m),
            omega: estimate(self.f_hz, self.u_f_hz).scaled(TAU),
            drive: self.drive(),
            phase: self.phase_target_deg.to_radians(),
        };
        measured.in_metres(units)
    }
}

/// A value and its standard uncertainty with two digits of it.
pub fn with_decimals((value, uncertainty): (f64, f64)) -> String {
    if !uncertainty.is_finite() {
        return "not determined".into();
    }
    let decimals = decimals(uncertainty);
    format!("{value:.decimals$} ± {uncertainty:.decimals$}")
}

/// Natural frequency and damping ratio in words.
pub fn linear_in_words(linear: &MeasuredLinear) -> String {
    let [f0, zeta] = linear
        .estimates()
        .map(|one| with_decimals((one.value, one.uncertainty)));
    format!("f0 = {f0} Hz, zeta = {zeta}")
}

/// Decimals for two digits of a standard uncertainty.
pub fn decimals(uncertainty: f64) -> usize {
    if uncertainty > 0.0 && uncertainty.is_finite() {
        (1.0 - uncertainty.log10().floor()).clamp(0.0, 15.0) as usize
    } else {
        6
    }
}

/// Asks what the sensor of the response reads, of a measurement that `vines` has not made: the default scene reads v, which no sensor on a structure
/// shows, and the results would be wrong by several standard uncertainties.
///
/// # Errors
/// A scene that does not say it.
pub fn requires_sensor(origin: &str, scene: &Scene) -> Result<(), ArgumentError> {
    let unstated = || {
        format!(
            "{origin}: what does the sensor of the response read? It is not from `vines`, and the scene does not say it: set resonance.sensor = \"q1\" \
             for a sensor on the structure (in the file of --scene, or --set resonance.sensor=q1), or \"v\" for q1 + m/M q2"
        ).into()
    };
    scene.states_sensor.then_some(()).ok_or_else(unstated)
}

/// What was measured on a rig.
#[derive(Debug, Clone)]
pub struct Measurements {
    /// Points of its backbone.
    pub points: Vec<MeasuredPoint>,
    /// Recordings.
    pub recordings: Vec<Recording>,
    /// Linear responses.
    pub linear: Vec<MeasuredLinear>,
    /// What is known from elsewhere.
    pub known: Vec<Known>,
    /// Standard uncertainty of the gain of the reference, relative.
    pub calibration: f64,
}

impl Default for Measurements {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            recordings: Vec::new(),
            linear: Vec::new(),
            known: Vec::new(),
            calibration: CALIBRATION,
        }
    }
}

/// The rig that fits what was measured.
#[derive(Debug, Clone)]
pub struct Found {
    /// Every hypothesis.
    pub hypotheses: Hypotheses,
    /// What they were fitted to.
    pub data: Data,
    /// The motions of the recordings, one after the other.
    pub stretches: Vec<Stretch>,
    /// What the data say of the linear responses.
    pub linear: Vec<LinearVerdict>,
}

/// Fits every hypothesis to all measurements. `progress` is told the number of hypotheses that are done.
///
/// # Errors
/// As [`Data::ideal`] and [`Recording::curve`].
pub fn find(
    measured: &Measurements,
    scene: &Scene,
    progress: impl FnMut(usize),
) -> Result<Found, Box<dyn Error + Send + Sync>> {
    plausible(&measured.points, scene)?;
    let curves: Result<Vec<_>, _> = measured.recordings.iter().map(|one| one.curve(scene)).collect();
    let (curves, stretches): (Vec<_>, Vec<_>) = curves?.into_iter().unzip();
    let mut data = Data {
        points: measured.points.clone(),
        curves,
        known: measured.known.clone(),
        definition: scene.definition(),
        calibration: measured.calibration,
        scene: (!measured.recordings.is_empty()).then(|| recording::rough(scene)),
    };
    let linear = linear_verdicts(&measured.linear, &data, &scene.plant)?;
    data.known.extend(linear.iter().map(|one| Known::Linear(one.linear)));
    let hypotheses = data.hypotheses(&scene.plant, progress)?;
    Ok(Found { hypotheses, data, stretches: stretches.concat(), linear })
}

/// Refuses points whose drive is no drive at phase resonance: there the response is larger than the base, and the base feeds at least what the damper takes.
fn plausible(points: &[MeasuredPoint], scene: &Scene) -> Result<(), ArgumentError> {
    let (Units { response, reference, .. }, stated) = (scene.units(), scene.knowledge().linear.bandwidth());
    for (n, MeasuredPoint { response: a, drive: e, .. }) in points.iter().enumerate() {
        let allowed = 2.0 * recording::LEAST_DAMPING * a.value..a.value;
        if e.value > 0.0 && a.value > 0.0 && !allowed.contains(&e.value) {
            return Err(format!(
                "point {}: at phase resonance a response of {:.4e} needs a drive between {:.4e} and {:.4e} (without impacts, with the damping of the \
                 scene, {:.4e}), and this one is {:.4e}: give the units of both, for instance --column A=NAME:mm --column E=NAME:um",
                n + 1,
                response.quantity(a.value),
                reference.quantity(allowed.start),
                reference.quantity(allowed.end),
                reference.quantity(stated * a.value),
                reference.quantity(e.value)
            ).into());
        }
    }
    Ok(())
}

/// What the data say of a linear response that was measured beside them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LinearVerdict {
    /// The linear response. Its state is known if the fit takes it.
    pub linear: MeasuredLinear,
    /// Rise of the chi-square of an ideal cavity by these data if the particle was carried along, and if it was free; absent for a state that the
    /// measurement excludes.
    pub rises: [Option<f64>; 2],
}

impl LinearVerdict {
    /// Whether a state agrees with the data: the probability of a larger rise, of two degrees of freedom, is at least 1 %.
    pub fn agrees(&self) -> [bool; 2] {
        let is_likely = |rise: f64| probability(rise, 2.0).is_some_and(|p| p >= DISAGREES);
        self.rises.map(|rise| rise.is_some_and(is_likely))
    }
}

/// What the data say of linear responses: data of the fit if exactly one state of the particle agrees with them.
fn linear_verdicts(
    linear: &[MeasuredLinear],
    data: &Data,
    expected: &Parameters,
) -> Result<Vec<LinearVerdict>, FitError> {
    if linear.is_empty() {
        return Ok(Vec::new());
    }
    let ideal = data.ideal(expected)?;
    let verdict = |linear: &MeasuredLinear| {
        let is_possible = |particle| [particle, ParticleState::Unknown].contains(&linear.particle);
        let states = [ParticleState::Carried, ParticleState::Free];
        let known = states
            .map(|particle| is_possible(particle).then_some(Known::Linear(MeasuredLinear { particle, ..*linear })));
        let found = LinearVerdict { linear: *linear, rises: data.rises(&ideal, known) };
        let particle = match found.agrees() {
            [true, false] => ParticleState::Carried,
            [false, true] => ParticleState::Free,
            _ => ParticleState::Unknown,
        };
        LinearVerdict { linear: MeasuredLinear { particle, ..*linear }, ..found }
    };
    Ok(linear.iter().map(verdict).collect())
}

/// How points contradict the rig that is expected.
#[derive(Debug, Clone)]
pub struct Contradiction {
    /// Number of points.
    pub points: usize,
    /// Their chi-square at the expected rig.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// The parameters of an ideal cavity that differ significantly; absent if none describes the points, or these are too few for a fit.
    pub parameters: Option<Vec<FittedParameter>>,
}

/// How the points contradict the rig `expected`. `None` where they do not, or cannot tell, or where the rig has effects of a real cavity. What is
/// systematic in the uncertainties of points is alike from point to point. Where no parameter differs, it may be one error, whose square all of
/// chi-square repeats.
pub fn contradiction(points: &[MeasuredPoint], definition: Definition, expected: &Parameters) -> Option<Contradiction> {
    let scene = Some(expected).filter(|expected| expected.cavity == Cavity::IDEAL)?;
    let data = Data { points: points.to_vec(), definition, ..Data::default() };
    let is_rejected = |fit: &Fit| fit.p_value().is_some_and(|p| p < EXCLUDED);
    let Fit { chi_square, degrees, .. } = data.at(scene).filter(is_rejected)?;
    let fitted = match data.ideal(expected) {
        Err(FitError::TooFew(_)) => None,
        fitted => Some(fitted.ok()?).filter(|fit| !is_rejected(fit)),
    };
    let differs = |one: &FittedParameter| (one.value - one.expected).abs() > SIGNIFICANT * one.uncertainty;
    let parameters: Option<Vec<_>> = fitted.map(|fit| {
        let all = parameters(expected, |quantity| fit.estimate(quantity));
        all.into_iter().filter(differs).collect()
    });
    let may_be_one = || probability(chi_square / degrees as f64, 1.0).is_none_or(|p| p >= EXCLUDED);
    if parameters.as_ref().is_some_and(Vec::is_empty) && may_be_one() {
        return None;
    }
    Some(Contradiction { points: points.len(), chi_square, degrees, parameters })
}

/// A fit in numbers, for programs.
#[derive(Debug, Clone, Serialize)]
pub struct FitReport {
    /// Whether a cavity describes the data, and a nonlinear spring without a particle does not.
    pub describes: bool,
    /// Symbols of the first five that the data do not determine.
    pub undetermined: Vec<&'static str>,
    /// The parameters, over the range of the hypotheses that are not excluded: first f0, zeta, r, b and epsilon, then, with a known scale, M, m, k and
    /// c.
    pub parameters: Vec<FittedParameter>,
    /// Every hypothesis that was fitted.
    pub hypotheses: Vec<HypothesisReport>,
    /// Names of those that were not: the plant has no motions with the responses of the data near what is expected of the rig.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_fitted: Vec<&'static str>,
    /// Name of the hypothesis whose values are those of a scene: the ideal cavity if it is possible, otherwise the possible one that fits best.
    pub best: &'static str,
    /// Chi-square of this one.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Probability of a larger chi-square; absent without a degree of freedom.
    pub p_value: Option<f64>,
    /// Correlations of the first five.
    pub correlations: Vec<[f64; 5]>,
    /// Residuals of the points over their standard uncertainties: response, frequency, drive.
    pub residuals: Vec<[f64; 3]>,
}

/// The fit of one hypothesis.
#[derive(Debug, Clone, Serialize)]
pub struct HypothesisReport {
    /// Its name.
    pub hypothesis: &'static str,
    /// Symbol of its strength; empty without one.
    pub symbol: &'static str,
    /// Unit of its strength; empty for a pure number.
    pub unit: &'static str,
    /// Its strength.
    pub strength: Option<f64>,
    /// Standard uncertainty of its strength.
    pub u_strength: Option<f64>,
    /// Coefficient of the friction beside it.
    pub friction: Option<f64>,
    /// Standard uncertainty of the friction.
    pub u_friction: Option<f64>,
    /// Its parameters.
    pub parameters: Vec<FittedParameter>,
    /// Chi-square of each channel.
    pub channels: Vec<ChannelTest>,
    /// Chi-square.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Probability of a larger chi-square; absent without a degree of freedom.
    pub p_value: Option<f64>,
    /// Why it is excluded; absent where it is possible.
    pub excluded: Option<String>,
}

/// A parameter of a fit.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FittedParameter {
    /// Its symbol.
    pub symbol: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// Its standard uncertainty.
    pub uncertainty: f64,
    /// The value that was expected.
    pub expected: f64,
}

/// The quantities that have an estimate, beside those of the rig that was expected.
fn parameters(expected: &Parameters, estimate: impl Fn(Quantity) -> Option<Estimate>) -> Vec<FittedParameter> {
    let parameter = |quantity: Quantity| {
        let (Estimate { value, uncertainty }, [symbol, unit]) = (estimate(quantity)?, quantity.symbol());
        let expected = quantity.of_plant(expected);
        Some(FittedParameter { symbol, unit, value, uncertainty, expected })
    };
    Quantity::ALL.into_iter().filter_map(parameter).collect()
}

impl Found {
    /// The plant of the best hypothesis.
    pub fn plant(&self, scene: &Parameters) -> Parameters {
        self.hypotheses.best().plant(scene)
    }

    /// What contradicts the best hypothesis most.
    pub fn worst(&self) -> String {
        self.data.worst(self.hypotheses.best())
    }

    /// The numbers of the fit, beside those of the rig that was expected.
    pub fn report(&self, expected: &Parameters) -> FitReport {
        let (all, best) = (&self.hypotheses, self.hypotheses.best());
        let hypothesis = |fit: &Fit| {
            let [hypothesis, symbol, unit] = fit.hypothesis.names();
            HypothesisReport {
                hypothesis,
                symbol,
                unit,
                strength: fit.strength().map(|one| one.value),
                u_strength: fit.strength().map(|one| one.uncertainty),
                friction: fit.friction().map(|one| one.value),
                u_friction: fit.friction().map(|one| one.uncertainty),
                parameters: parameters(expected, |quantity| fit.estimate(quantity)),
                channels: fit.channels.clone(),
                chi_square: fit.chi_square,
                degrees: fit.degrees,
                p_value: fit.p_value(),
                excluded: fit.excluded.clone(),
            }
        };
        let correlations = |row: &Quantity| std::array::from_fn(|n| best.correlation(*row, Quantity::FITTED[n]));
        FitReport {
            describes: all.describes(),
            undetermined: all.undetermined().into_iter().map(|one| one.symbol()[0]).collect(),
            not_fitted: all.not_fitted.iter().map(|one| one.names()[0]).collect(),
            parameters: parameters(expected, |quantity| all.range(quantity)),
            hypotheses: all.fits.iter().map(hypothesis).collect(),
            best: best.hypothesis.names()[0],
            chi_square: best.chi_square,
            degrees: best.degrees,
            p_value: best.p_value(),
            correlations: Quantity::FITTED.iter().map(correlations).collect(),
            residuals: best.residuals.clone(),
        }
    }
}
