//! Options that several commands share: the scene, rigs and controllers, and what the network may reach.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Arc, OnceLock};

use clap::Args;
use phase_lock::Config;
use vines::ArgumentError;
use vines::fmu::{Connection, FmuController, FmuError};
use vines::helic::{DEFAULT_PORT, HelicRig, LONGEST_SILENCE, Network};
use vines::net::{Address, BindScope, Key, NetController, NetRig, ReportLost, Timing, resolve};
use vines::rig::{BuiltIn, Chain, Controller, Rig, Simulated, Stoppable};
use vines::scene::{Dimensionless, Family, Implausible, Measurand, Names, Override, PAPER, Scene, SceneError};
use vines::table::{Table, lines};
use vines::{cells, fmu_rig};

use super::failure::Failure;
use super::output::log_warnings;
use super::signals::{reachable, stop_flag};
use super::summary::ideal;

#[derive(Debug, Clone, Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML); without it, the default scene
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,

    /// Replace one value of the scene, such as plant.r=0.7; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
}

impl SceneArguments {
    /// These arguments as words of a command line.
    pub(super) fn words(&self) -> impl Iterator<Item = String> {
        let scene = self.scene.iter().map(|path| format!("--scene={}", path.display()));
        scene.chain(self.set.iter().map(|setting| format!("--set={setting}")))
    }

    /// The scene; a warning names values that are hardly meant.
    pub(super) fn load(&self) -> Result<Scene, SceneError> {
        log_warnings();
        let scene = Scene::load(self.scene.as_deref(), &self.set)?;
        warn_implausible(&scene, "A scene has");
        Ok(scene)
    }

    /// The text of the scene's file with another section `[plant]`, and without comments: they may be about the plant that it had.
    pub(super) fn with_plant(&self, plant: &str) -> Result<String, SceneError> {
        let text = self.text()?.unwrap_or_else(|| PAPER.into());
        let (mut lines, mut inside) = (String::new(), false);
        for line in text.lines() {
            let is_comment = |(n, _): &(usize, &str)| line[..*n].matches(['"', '\'']).count() % 2 == 0;
            let comment = line.match_indices('#').find(is_comment);
            let line = comment.map_or(line, |(n, _)| &line[..n]).trim_end();
            let begins = line.trim_start().starts_with("[plant]");
            inside = begins || inside && !line.trim_start().starts_with('[');
            let is_second_blank = line.is_empty() && (lines.is_empty() || lines.ends_with("\n\n"));
            if begins || !(inside || is_second_blank) {
                lines += &format!("{}\n", if begins { plant } else { line });
            }
        }
        Ok(lines)
    }

    /// The scene, of which numbers may vary.
    pub(super) fn family(&self) -> Result<Family, SceneError> {
        let name = self.scene.as_ref().map(|path| path.display().to_string());
        Family::parse(&name.unwrap_or_default(), self.text()?.as_deref(), &self.set)
    }

    /// The text of the scene's file.
    fn text(&self) -> Result<Option<String>, SceneError> {
        let Some(path) = &self.scene else { return Ok(None) };
        Scene::text(path).map(Some)
    }
}

/// Warns of values that are hardly meant. `whose`: what has them, and a verb.
pub(super) fn warn_implausible(scene: &Scene, whose: &str) {
    let named = scene
        .implausible()
        .map(|Implausible { name, value, unit }| format!("{name} = {value:.3} {unit}"));
    let named: Vec<String> = named.map(|text| text.trim_end().into()).collect();
    if !named.is_empty() {
        log::warn!(
            "{}: is this meant? {whose} k in N/m, M and m in kg, c in N s/m, b in m, and a shaker is in the same units",
            named.join(", ")
        );
    }
}

/// Warns that `results` are of the ideal cavity, if they leave something out.
pub(super) fn warn_left_out(left_out: Option<String>, results: &str) {
    if let Some(left_out) = left_out {
        log_warnings();
        log::warn!("{}", ideal(results, &left_out));
    }
}

/// An implementation, as written on the command line.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Endpoint {
    /// `built-in`: the implementation in this program.
    BuiltIn,
    Fmu(PathBuf),
    /// `tcp://HOST:PORT` or `udp://HOST:PORT`.
    Network(String),
}

impl FromStr for Endpoint {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "built-in" {
            return Ok(Self::BuiltIn);
        }
        if text.contains("://") {
            return Ok(Self::Network(text.into()));
        }
        match PathBuf::from(text) {
            file if file.is_file() => Ok(Self::Fmu(file)),
            _ => Err(format!(
                "{text} does not exist; give `built-in`, the path of an FMU, tcp://HOST:PORT, or for a rig in real time \
                 udp://HOST:PORT or helic://HOST[:PORT]"
            )
            .into()),
        }
    }
}

pub(super) struct OpenRig {
    pub rig: Box<dyn Rig>,
    /// In real time, the longest silence that it tolerates, s.
    pub pace: Option<f64>,
    /// In real time, what it reports when the session has ended.
    timing: Arc<OnceLock<Result<Timing, ReportLost>>>,
}

impl OpenRig {
    /// Ends the session of a rig in real time. Its report has the missed deadlines.
    pub(super) fn close(self) -> Option<Result<Timing, ReportLost>> {
        drop(self.rig);
        self.timing.get().copied()
    }
}

impl Endpoint {
    /// What the bench uses of an FMU, in words; empty for other endpoints.
    pub(super) fn variables(
        &self,
        role: &str,
        connections: impl Fn(&Path) -> Result<Vec<Connection>, FmuError>,
    ) -> Result<String, Failure> {
        let Self::Fmu(file) = self else {
            return Ok(String::new());
        };
        let connections = connections(file)?;
        let is_same = |one: &Connection| {
            let of_same_unit = |unit: &Option<String>| unit.as_deref().is_none_or(|unit| unit == one.si);
            let theirs = one.theirs.as_ref();
            one.factor == 1.0 && theirs.is_some_and(|(name, unit)| *name == one.ours && of_same_unit(unit))
        };
        let named = |what: &str, is: &dyn Fn(&Connection) -> bool| {
            let names: Vec<&str> = connections.iter().filter(|one| is(one)).map(|one| &*one.ours).collect();
            lines((!names.is_empty()).then(|| format!("  {what}: {}", names.join(", "))))
        };
        let rows = connections.iter().filter(|one| !is_same(one)).filter_map(|one| {
            let (name, unit) = one.theirs.clone()?;
            let unit = unit.unwrap_or_else(|| "not declared".into());
            Some(cells![one.ours.clone(), one.si.to_string(), name, unit, one.factor])
        });
        let table = Table::new("bench | SI unit | FMU | its unit | SI per unit").rows(rows);
        Ok([
            format!("Variables of the {role} {}\n", file.display()),
            named("as on the bench", &is_same),
            named("not there", &|one| one.theirs.is_none()),
            named("not set before the start, by their causality", &|one| {
                one.keeps_its_start
            }),
            table.text_under(""),
            "\n".into(),
        ]
        .concat())
    }

    /// The rig of this endpoint.
    pub(super) fn rig(&self, scene: &Scene, scope: BindScope) -> Result<OpenRig, Failure> {
        if let (Some(structure), Self::Network(address)) = (&scene.structure, self)
            && address.starts_with("helic://")
        {
            return Err(Failure::input(format!(
                "a helic device has one oscillator, and the scene has a {}; serve it with `vines rig` over tcp:// or udp://",
                structure.section()
            )));
        }
        let jumps = scene.chain.hold
            && scene
                .structure
                .as_ref()
                .is_none_or(|structure| structure.shaker.is_none());
        if jumps && scene.chain.reference && !matches!(self, Self::Network(_)) {
            log::warn!(
                "chain.hold = true: a simulated base jumps from sample to sample, and its sensor reads it half a sample late; the lock is \
                 {:.2} degrees off. Set chain.reference = false",
                180.0 / scene.controller.samples_per_period
            );
        }
        let (mut pace, mut timing) = (None, Arc::default());
        let rig: Box<dyn Rig> = match self {
            Self::BuiltIn => Simulated::without_chain(scene)?,
            Self::Fmu(file) => reachable(fmu_rig::load(file, scene)?, scene.sample_time()),
            Self::Network(address) if address.starts_with("helic://") => {
                reachable(helic(address, scene, scope)?, scene.sample_time())
            }
            Self::Network(address) => {
                let rig = NetRig::connect(Address::parse(address, scope)?, scene.sample_time(), scope.key())?;
                let rig = rig.with_sensors(scene.resonance)?;
                pace = rig.pace();
                timing = rig.timing();
                reachable(rig, scene.sample_time())
            }
        };
        let rig = Chain::around(rig, scene);
        let rig = Box::new(Stoppable::around(rig, scene.sample_time(), &stop_flag()));
        Ok(OpenRig { rig, pace, timing })
    }

    /// The controller of this endpoint with its configuration, for a rig of that `pace`. One at a network address has its own.
    pub(super) fn controller(
        &self,
        config: &Config,
        names: &Names,
        scope: BindScope,
        pace: Option<f64>,
    ) -> Result<Box<dyn Controller>, Failure> {
        Ok(match self {
            Self::BuiltIn => Box::new(BuiltIn::new(config)?),
            Self::Fmu(file) => Box::new(FmuController::load(file, config, names)?),
            Self::Network(address) => {
                let Address::Tcp(peer) = Address::parse(address, scope)? else {
                    let rule = "a controller has an address tcp://HOST:PORT";
                    return Err(Failure::input(format!("{address}: {rule}")));
                };
                Box::new(NetController::connect(peer, config, pace, scope.key())?)
            }
        })
    }
}

/// The helic device at `helic://HOST[:PORT]`.
fn helic(address: &str, scene: &Scene, scope: BindScope) -> Result<HelicRig<Network>, Failure> {
    no_key(scope)?;
    let measured = ["response", "base"].into_iter().zip(scene.resonance.measurands());
    for (ours, measurand) in measured {
        let stated = match scene.rig_names.mapped(ours) {
            Some(name) => name.si.unwrap_or(measurand.unit()),
            None => Measurand::Displacement.unit(),
        };
        if stated != measurand.unit() {
            let (quantity, unit) = (measurand.name(), measurand.unit());
            return Err(Failure::input(format!(
                "{address}: the {ours} of the device is in a unit of {stated}, and the scene needs its {quantity}, {unit}: name the channel and its unit in \
                 [rig.names], and its quantity in [resonance]"
            )));
        }
    }
    let place = address.trim_start_matches("helic://");
    let port = place.rsplit_once(':').and_then(|(_, port)| port.parse::<u16>().ok());
    let place = port.map_or_else(|| format!("{place}:{DEFAULT_PORT}"), |_| place.into());
    let network = Network::connect(resolve(&place, scope)?, LONGEST_SILENCE).map_err(|error| {
        let advice = "is `vines rig --protocol helic` or a device running there?";
        Failure::run(format!("no answer from {address}: {error}; {advice}"))
    })?;
    let samples = scene.controller.samples_per_period;
    Ok(HelicRig::new(network, &scene.rig_names, scene.sample_time(), samples)?)
}

/// Refuses a key where the protocol has none.
pub(super) fn no_key(scope: BindScope) -> Result<(), Failure> {
    let message = "--key: the helic protocol has no authentication; drop --key, and use --allow-remote only on a network where everyone may \
                   drive the rig";
    scope.key().map_or(Ok(()), |_| Err(Failure::input(message)))
}

#[derive(Debug, Args)]
pub(super) struct ReachArguments {
    /// Allow network addresses beyond this machine without a key: anyone who can reach the address can drive the rig
    #[arg(long)]
    allow_remote: bool,

    /// File with a shared key of 16 bytes or more, the same on both sides; allows network addresses beyond this machine
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
}

impl ReachArguments {
    /// Which addresses the network may use.
    pub(super) fn reach(&self) -> Result<BindScope, Failure> {
        let file = match &self.key {
            Some(file) => file,
            None if self.allow_remote => return Ok(BindScope::Remote),
            None => return Ok(BindScope::Loopback),
        };
        let refused = |reason: String| Failure::input(format!("--key {}: {reason}", file.display()));
        let secret = std::fs::read(file).map_err(|error| refused(error.to_string()))?;
        let short = || refused("16 bytes or more are needed; `openssl rand -hex 32` writes a good key".into());
        Key::of(&secret).map(BindScope::Keyed).ok_or_else(short)
    }
}

/// A number above 0 and at most 1e8, for seconds and metres.
pub(super) fn positive(text: &str) -> Result<f64, ArgumentError> {
    let value: f64 = text.parse().map_err(|_| "expected a number")?;
    match value > 0.0 && value <= 1e8 {
        true => Ok(value),
        false => Err("must be above 0 and at most 1e8".into()),
    }
}

/// Refuses a detuning, of the option `name`, whose frequency is not positive.
pub(super) fn positive_frequency(name: &str, scene: &Dimensionless, sigma: f64) -> Result<(), Failure> {
    match 1.0 + scene.epsilon * sigma > 0.0 && sigma.is_finite() {
        true => Ok(()),
        false => Err(Failure::input(format!(
            "{name} = {sigma} (dimensionless): it must be finite, and above -1/epsilon = {:.4}, where the frequency is 0",
            -1.0 / scene.epsilon
        ))),
    }
}
