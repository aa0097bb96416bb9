//! `Structure.fmu`: its description, which has the variables of `LoViNes.fmu` that a structure has and outputs at its points, and the
//! structure as its library reads it.

use std::borrow::Cow;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::fmt::Display;

use fmi2_component::guid_of;
use fmi2_description::{Element, Error};
use lovines::table::PARAMETERS;
use phase_lock::Value;
use serde_json::json;

use super::{Component, PackError, START_PARAMETERS, lock, parameter_set};
use crate::scene::{ARMATURE, Channel, Reference, Scene, SceneShaker, Structure, TABLE};
use crate::table::Table;

/// `modelIdentifier`.
const IDENTIFIER: &str = "Structure";
/// The file of the structure.
const FILE: &str = "resources/structure.json";

/// The FMU of a structure, which has the library of the oscillator.
pub fn component(oscillator: &Component, structure: &Structure, scene: &Scene) -> Result<Component, PackError> {
    let starts = scene
        .start_values()
        .into_iter()
        .filter_map(|(name, value)| match value {
            Value::Real(value) => Some((name, value)),
            Value::Integer(value) => Some((name, f64::from(value))),
            Value::Boolean(_) => None,
        });
    let starts: Vec<(&str, f64)> = starts.collect();
    let step = scene.sample_time();
    let content = resource(structure, &starts, step);
    let facts = Facts {
        guid: guid_of(&oscillator.library_guid, &content),
        drive: DriveKind::of(structure),
        channels: structure.channels(),
        starts,
        step,
        stop: STRUCTURE_PERIODS * TAU / structure.mode().omega,
    };
    let xml = describe(&oscillator.xml, &facts)?;
    let ([signal, input, _], ..) = facts.drive.names();
    let parameters = scene.start_values().into_iter().filter(|(name, _)| {
        let is_parameter = PARAMETERS.iter().any(|row| row.symbol == *name);
        is_parameter && !ABSENT.contains(name)
    });
    // Behind a shaker, the command that makes this drive of a structure that does not move.
    let units = structure.units();
    let amplitude = units.command.of_metres(SINE_SHARE * scene.amplitude);
    let parameters = parameter_set("plant", parameters);
    let experiment = lock::sine((structure, scene), ([signal, input], amplitude), step, parameters)?;
    Ok(Component {
        identifier: IDENTIFIER,
        package: oscillator.package,
        xml,
        library_guid: oscillator.library_guid.clone(),
        png: b"",
        page: page(structure, step),
        files: [(FILE.to_owned(), content)].into_iter().chain(experiment).collect(),
    })
}

/// Drive of the experiment inside the FMU, over the scene's: within the limits of a shaker.
const SINE_SHARE: f64 = 0.1;

/// The end of the default experiment, periods of the driven mode.
const STRUCTURE_PERIODS: f64 = 100.0;

/// What the description cannot say, as HTML; `step` is that of the default experiment, s.
fn page(structure: &Structure, step: f64) -> Cow<'static, str> {
    let modes = structure.modes.iter().map(|mode| {
        let shape = structure
            .points
            .iter()
            .zip(&mode.shape)
            .map(|(point, value)| format!("{point} {value:.6}"));
        let numbers = [mode.omega / TAU, mode.zeta, mode.drive].map(|number| format!("{number:.6}"));
        let [frequency, damping, drive] = numbers;
        [frequency, damping, drive, shape.collect::<Vec<_>>().join(", ")]
    });
    let head = "frequency, Hz | damping ratio | drive | mass-normalised shape, 1/sqrt(kg)";
    let mut drive = match structure.excitation {
        Reference::Base => {
            "The displacement of its base drives it; <em>drive</em> is the participation factor, sqrt(kg).".to_owned()
        }
        Reference::Force => "A force drives it; <em>drive</em> is the shape at the force's point, 1/sqrt(kg).".into(),
    };
    if structure.shaker.is_some() {
        drive += &format!(
            " A shaker moves the structure, by the command <code>u</code> of its amplifier, V, which is clipped at the amplifier's limit. \
             The other limits of the shaker are checked at every communication point, and within a step at least every {step} s. A step \
             that finds one passed ends there with an error, which names it."
        );
    }
    let text = format!(
        "<p>A linear structure carries a cavity, in which a particle flies freely and hits the walls. {drive} Between impacts the motion is a \
         closed formula; there is no step-size error. The structure is fixed, in <code>{FILE}</code>; parameters of cavity and \
         particle can be set. The FMU is for co-simulation.</p>"
    );
    Cow::Owned(text + &Table::new(head).rows(modes).html("Modes").into_string())
}

/// What the description depends on.
struct Facts<'a> {
    guid: String,
    drive: DriveKind,
    /// In the order of their value references.
    channels: Vec<Channel<'a>>,
    /// Start values by name; other variables keep theirs.
    starts: Vec<(&'a str, f64)>,
    /// Step and end of the default experiment, s.
    step: f64,
    stop: f64,
}

/// The structure as its library reads it. Limits are checked at least every `interval` seconds, as often as the simulated rig checks them.
fn resource(structure: &Structure, starts: &[(&str, f64)], interval: f64) -> Vec<u8> {
    let point = |channel: Channel<'_>| {
        let mut point = json!({"name": channel.name, "row": channel.row});
        if channel.per_drive != 0.0 {
            point["per_drive"] = json!(channel.per_drive);
        }
        if let Some(limit) = channel.limit {
            point["limit"] = json!(limit);
        }
        point
    };
    let points: Vec<_> = structure.channels().into_iter().map(point).collect();
    let start = |symbol: &str| {
        starts
            .iter()
            .find(|(name, _)| *name == symbol)
            .map_or(0.0, |(_, value)| *value)
    };
    let parameters = PARAMETERS.iter().filter_map(|row| {
        let (symbol, value) = starts.iter().find(|(name, _)| *name == row.symbol)?;
        Some(((*symbol).to_owned(), json!(value)))
    });
    let mut file = json!({
        "excitation": structure.host.excitation(),
        "equations": structure.equations,
        "points": points,
        "parameters": serde_json::Map::from_iter(parameters),
        "particle": [start("q2"), start("der(q2)")],
    });
    let largest = structure.shaker.as_ref().map(SceneShaker::largest_command);
    if let Some(largest) = largest.filter(|largest| largest.is_finite()) {
        file["largest_drive"] = json!(largest);
    }
    if structure.channels().iter().any(|channel| channel.limit.is_some()) {
        file["check_interval"] = json!(interval);
    }
    let mut text = serde_json::to_vec_pretty(&file).unwrap_or_default();
    text.push(b'\n');
    text
}

/// Value reference of the first output at a point. Those of point n are `FIRST_POINT_REFERENCE + 3 n` for its displacement, velocity and acceleration.
const FIRST_POINT_REFERENCE: u32 = 1000;

/// The outputs at a point: symbol, quantity, declared type, unit with its display unit.
const QUANTITIES: [(&str, &str, &str, [&str; 2]); 3] = [
    ("q", "displacement", "Displacement", ["m", "mm"]),
    ("v", "velocity", "Velocity", ["m/s", "mm/s"]),
    ("a", "acceleration", "Acceleration", ["m/s2", ""]),
];

/// Units that the oscillator has no need of: exponents of kg, m, s and A.
const UNITS: [(&str, [i32; 4]); 3] = [("N", [1, 1, -2, 0]), ("V", [1, 2, -3, -1]), ("A", [0, 0, 0, 1])];

/// Variables of one oscillator that a structure lacks: its own parameters and start are in the resources, and `v` is the centre of its
/// two masses. The others are of model exchange.
const ABSENT: [&str; 11] = [
    "M",
    "k",
    "c",
    "v",
    "q1_start",
    "der_q1_start",
    "u1",
    "der(u1)",
    "u2",
    "der(u2)",
    "der(phase)",
];

/// Variables that follow from the structure.
const COMPUTED: [&str; 2] = ["q1", "der(q1)"];

/// Meanings that are others than those of the oscillator.
const MEANINGS: [(&str, &str); 8] = [
    (
        "omega",
        "frequency of the built-in oscillator, held during a step: input derivatives are accepted and have no effect; its phase is continuous",
    ),
    ("q1", "displacement of the structure at the cavity"),
    ("der(q1)", "velocity of the structure at the cavity"),
    ("der(q2)", "velocity of the particle"),
    (
        "w",
        "q1 - q2: displacement of the cavity relative to the particle, from -b to b",
    ),
    ("der(w)", "velocity of the cavity relative to the particle"),
    (
        "phase",
        "phase of the built-in oscillator of the drive, 0 at the start, brought back to [0, 2 pi)",
    ),
    (
        "energy",
        "mechanical energy: of the structure with its shaker, relative to a base at its displacement, of the particle, and of its weight on a \
         tilted axis",
    ),
];

/// What drives the structure, as the names of its variables say.
#[derive(Clone, Copy)]
enum DriveKind {
    Base,
    Force,
    Command,
}

impl DriveKind {
    fn of(structure: &Structure) -> Self {
        match (&structure.shaker, structure.excitation) {
            (Some(_), _) => Self::Command,
            (None, Reference::Base) => Self::Base,
            (None, Reference::Force) => Self::Force,
        }
    }

    /// The names of signal, amplitude and total, what they are of, and their quantity with its unit.
    fn names(self) -> ([&'static str; 3], &'static str, [&'static str; 2]) {
        match self {
            Self::Base => (BASE, "base displacement", ["", "m"]),
            Self::Force => (["F", "F_amplitude", "force"], "force", ["Force", "N"]),
            Self::Command => (
                ["u", "u_amplitude", "command"],
                "command of the amplifier",
                ["ElectricPotential", "V"],
            ),
        }
    }

    /// What a variable of the oscillator's base means; its place is that in [`BASE`].
    fn meaning(self, place: usize) -> String {
        let ([signal, amplitude, _], of, _) = self.names();
        let no_derivatives = "held during a step: input derivatives are accepted and have no effect";
        match (place, self) {
            (0, _) => {
                format!("{of}, signal: held between samples, or a polynomial where input derivatives are given")
            }
            (1, _) => format!("amplitude of the built-in oscillator of the {of}, added to {signal}; {no_derivatives}"),
            (_, Self::Command) => {
                format!("total {of} {signal} + {amplitude} sin(phase), clipped at the limit of the amplifier")
            }
            _ => format!("total {of} {signal} + {amplitude} sin(phase): what the reference sensor reads"),
        }
    }
}

/// Signal, amplitude and total of the base of an oscillator.
const BASE: [&str; 3] = ["e", "E", "base"];

/// The description of a structure, from that of `LoViNes.fmu`.
fn describe(oscillator: &str, facts: &Facts<'_>) -> Result<String, Error> {
    let mut root = Element::parse(oscillator)?;
    root.set("modelName", IDENTIFIER);
    root.set("guid", &facts.guid);
    // A point is an index in brackets, which in structured names would have to be a number.
    root.set("variableNamingConvention", "flat");
    root.remove("numberOfEventIndicators");
    root.set(
        "description",
        "Structure with a vibro-impact nonlinear energy sink: a particle flies freely in a cavity of the structure and hits its walls",
    );
    root.children
        .retain(|child| !["ModelExchange", "ModelStructure"].contains(&child.name.as_str()));
    let interface = root.child("CoSimulation");
    interface.set("modelIdentifier", IDENTIFIER);
    interface.set("providesDirectionalDerivative", false);
    interface.remove("maxOutputDerivativeOrder");
    let experiment = root.child("DefaultExperiment");
    experiment.remove("tolerance");
    experiment.set("stopTime", facts.stop);
    experiment.set("stepSize", facts.step);
    let units: &[(&str, [i32; 4])] = match facts.drive {
        DriveKind::Base => &[],
        DriveKind::Force => &UNITS[..1],
        DriveKind::Command => &UNITS,
    };
    for (name, [kg, m, s, ampere]) in units {
        let base = leaf("BaseUnit", &[("kg", kg), ("m", m), ("s", s), ("A", ampere)]);
        let unit = Element::new("Unit", &[("name", name)], vec![base]);
        root.child("UnitDefinitions").children.push(unit);
    }
    let variables = root.child("ModelVariables");
    variables.children = variables_of(std::mem::take(&mut variables.children), facts);
    let ([.., total], ..) = facts.drive.names();
    let structure = model_structure(&variables.children, total);
    root.children.push(structure);
    Ok(root.document())
}

/// An element without children.
fn leaf(name: &str, attributes: &[(&str, &dyn Display)]) -> Element {
    Element::new(name, attributes, Vec::new())
}

/// The variables of the structure, in the order of the oscillator's, and its points.
fn variables_of(oscillator: Vec<Element>, facts: &Facts<'_>) -> Vec<Element> {
    let (mut kept, mut places) = (Vec::new(), HashMap::new());
    for (n, mut variable) in oscillator.into_iter().enumerate() {
        if ABSENT.contains(&variable.get("name")) {
            continue;
        }
        adapt(&mut variable, facts);
        kept.push(variable);
        places.insert((n + 1).to_string(), kept.len());
    }
    for content in kept.iter_mut().flat_map(|variable| &mut variable.children) {
        if let Some(place) = places.get(content.get("derivative")) {
            content.set("derivative", place);
        }
    }
    for (n, channel) in facts.channels.iter().enumerate() {
        let name = channel.name;
        let limit = channel.limit.map_or(String::new(), |limit| {
            format!(
                "; beyond {limit} {} to either side the simulation ends with an error: checked at communication points and at least every {} s",
                channel.unit, facts.step
            )
        });
        let mut add = |k: usize, name: &str, meaning: &str, content: Element| {
            let attributes: [(&str, &dyn Display); 6] = [
                ("name", &name),
                ("valueReference", &(FIRST_POINT_REFERENCE as usize + 3 * n + k)),
                ("causality", &"output"),
                ("variability", &"continuous"),
                ("initial", &"calculated"),
                ("description", &meaning),
            ];
            kept.push(Element::new("ScalarVariable", &attributes, vec![content]));
        };
        if let Some(meaning) = channel.meaning {
            let is_force = channel.unit == "N";
            let quantity = if is_force { "Force" } else { "ElectricCurrent" };
            let content = leaf("Real", &[("quantity", &quantity), ("unit", &channel.unit)]);
            add(0, name, &(meaning.to_owned() + &limit), content);
            continue;
        }
        for (k, (symbol, quantity, kind, [unit, display])) in QUANTITIES.into_iter().enumerate() {
            let mut content = leaf("Real", &[("declaredType", &kind), ("unit", &unit)]);
            if !display.is_empty() {
                content.set("displayUnit", display);
            }
            let meaning = match name {
                ARMATURE => format!("{quantity} of the armature of the shaker"),
                TABLE => format!("{quantity} of the table of the shaker"),
                _ => format!("{quantity} of the structure at the point {name}"),
            };
            let meaning = if k == 0 { meaning + &limit } else { meaning };
            add(k, &format!("{symbol}[{name}]"), &meaning, content);
        }
    }
    kept
}

/// Makes a variable of the oscillator one of the structure.
fn adapt(variable: &mut Element, facts: &Facts<'_>) {
    let name = variable.get("name").to_owned();
    if let Some(place) = BASE.iter().position(|base| *base == name) {
        let (names, _, [quantity, unit]) = facts.drive.names();
        variable.set("name", names[place]);
        variable.set("description", facts.drive.meaning(place));
        if !quantity.is_empty() {
            variable.children[0] = leaf("Real", &[("quantity", &quantity), ("unit", &unit)]);
            if variable.get("causality") == "input" {
                variable.children[0].set("start", 0);
            }
        }
    }
    if let Some((_, meaning)) = MEANINGS.iter().find(|(other, _)| *other == name) {
        variable.set("description", meaning);
    }
    if COMPUTED.contains(&&*name) {
        variable.set("initial", "calculated");
        variable.children[0].remove("start");
        return;
    }
    // A start has the same value under both of its names.
    let output = START_PARAMETERS.iter().find(|(_, parameter)| *parameter == name);
    let name = output.map_or(&*name, |(output, _)| output);
    if let Some((_, start)) = facts.starts.iter().find(|(other, _)| *other == name) {
        variable.children[0].set("start", start);
    }
}

/// Which outputs there are. That of the drive follows its inputs at once, all others with the next step.
fn model_structure(variables: &[Element], drive: &str) -> Element {
    let all = |causality| {
        (1..)
            .zip(variables)
            .filter(move |(_, one)| one.get("causality") == causality)
    };
    let inputs: Vec<String> = all("input").map(|(n, _): (usize, _)| n.to_string()).collect();
    let inputs = inputs.join(" ");
    let outputs = all("output").map(|(n, one)| {
        let dependencies = if one.get("name") == drive { &*inputs } else { "" };
        leaf("Unknown", &[("index", &n), ("dependencies", &dependencies)])
    });
    let calculated = all("output").filter(|(_, one)| one.get("initial") == "calculated");
    let unknowns = calculated.map(|(n, _)| leaf("Unknown", &[("index", &n)]));
    let lists = [("Outputs", outputs.collect()), ("InitialUnknowns", unknowns.collect())];
    let lists = lists.map(|(name, children)| Element::new(name, &[], children));
    Element::new("ModelStructure", &[], lists.into())
}
