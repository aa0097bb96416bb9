//! The `[shaker]` section: an electrodynamic shaker between the command and a structure.

use std::f64::consts::TAU;

use lovines::host::{Equations, Row};
use lovines::oscillator::Oscillator;
use lovines::{Amplifier, Excitation as HostExcitation, Host, Plant, Shaker, ShakerRows};
use serde::{Deserialize, Serialize};

use super::{Excitation, Structure};
use crate::plan::ShakerPath;

/// Points that a shaker adds to those of a structure.
pub const ARMATURE: &str = "armature";
/// The table that carries a structure which is moved by its base.
pub const TABLE: &str = "table";

/// A shaker as a part of a structure, with what it is not driven beyond.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneShaker {
    /// The shaker.
    #[serde(flatten)]
    pub shaker: Shaker,
    /// Its limits.
    pub limits: Limits,
    /// The reference per command at the natural frequency, without impacts: N/V for a force, m/V for a table.
    pub reference_per_command: f64,
    /// What is measured.
    #[serde(skip)]
    pub rows: ShakerRows,
    /// The structure as the reference drives it: with the mass in front of the force cell.
    #[serde(skip)]
    pub alone: Box<Structure>,
}

/// Limits of a shaker. What the amplifier controls is clipped at its limit; reaching another one ends the experiment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Limits {
    /// Voltage of the coil, V.
    pub voltage: Option<f64>,
    /// Its current, A.
    pub current: Option<f64>,
    /// Displacement of the armature to each side, m.
    pub stroke: Option<f64>,
    /// Force of the stinger, N.
    pub force: Option<f64>,
}

impl SceneShaker {
    /// The limit of the command, V; infinite without one.
    pub fn largest_command(&self) -> f64 {
        let limit = match self.shaker.amplifier {
            Amplifier::Voltage => self.limits.voltage,
            Amplifier::Current => self.limits.current,
        };
        limit.map_or(f64::INFINITY, |limit| limit / self.shaker.gain)
    }

    /// The reference in the sections of the host: the force of the stinger, or the displacement of the table.
    pub fn reference(&self, excitation: Excitation) -> &Row {
        match excitation {
            Excitation::Base => &self.rows.end,
            Excitation::Force => &self.rows.force,
        }
    }
}

/// What is measured on a structure beside its drive: the displacement of a point, or a number at its shaker.
#[derive(Debug, Clone)]
pub struct Channel<'a> {
    /// Name of the point, or of the number.
    pub name: &'a str,
    /// Its value in the sections of the host.
    pub row: &'a Row,
    /// What one unit of the drive adds to it.
    pub per_drive: f64,
    /// Unit of the value.
    pub unit: &'static str,
    /// Largest magnitude allowed.
    pub limit: Option<f64>,
    /// Of a number, what it is; `None`: a point.
    pub meaning: Option<&'static str>,
}

impl Channel<'_> {
    /// Its value now.
    pub fn read(&self, plant: &Plant<lovines::Structure>) -> f64 {
        plant.point(self.row)[0] + self.per_drive * plant.base_displacement()
    }
}

impl Structure {
    /// The points of the structure, and what is measured at its shaker.
    pub fn channels(&self) -> Vec<Channel<'_>> {
        let point = |(name, row)| Channel {
            name,
            row,
            per_drive: 0.0,
            unit: "m",
            limit: None,
            meaning: None,
        };
        let points = self.points.iter().map(String::as_str).zip(&self.rows);
        let mut channels: Vec<_> = points.map(point).collect();
        let Some(SceneShaker { limits, rows, .. }) = &self.shaker else {
            return channels;
        };
        if self.excitation == Excitation::Base {
            channels.push(point((TABLE, &rows.end)));
        }
        channels.push(Channel { limit: limits.stroke, ..point((ARMATURE, &rows.armature)) });
        channels.push(Channel {
            unit: "N",
            limit: limits.force,
            meaning: Some("force of the stinger on the structure"),
            ..point(("force", &rows.force))
        });
        channels.push(Channel {
            per_drive: rows.current_per_command,
            unit: "A",
            limit: limits.current,
            meaning: Some("current of the coil"),
            ..point(("current", &rows.current))
        });
        channels
    }

    /// What the shaker makes of its command, for a controller with this range of frequencies, rad/s; `None` without a shaker.
    pub(crate) fn shaker_path(&self, range: [f64; 2]) -> Option<ShakerPath> {
        let (shaker, mode, host) = (self.shaker.as_ref()?, self.mode(), &self.host);
        let response = self.response();
        // The pole whose part of the response is largest.
        let part = |n: usize| {
            let ([x, v], [a, b]) = (host.sections()[n].steady(mode.omega), response[n]);
            (x * a + v * b).norm()
        };
        let largest = (0..response.len()).max_by(|one, other| part(*one).total_cmp(&part(*other)))?;
        let Oscillator { delta, omega0, .. } = host.sections()[largest].oscillator;
        let detuning = (omega0 * omega0 - delta * delta).max(0.0).sqrt() - mode.omega;
        let at = |omega: f64| host.frequency_response(shaker.reference(self.excitation), omega);
        let half_power = [-1.0, 1.0].map(|side| at(mode.omega * (1.0 + side * mode.zeta)));
        let ends = range.map(|omega| at(omega).norm());
        Some(ShakerPath {
            pole: [delta, detuning],
            drop_out: shaker.reference_per_command / ends[0].max(ends[1]),
            by_force: self.excitation == Excitation::Force,
            turn: (half_power[1] * half_power[0].conj()).arg(),
        })
    }
}

/// The section as written.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShakerSection {
    mass: f64,
    stiffness: f64,
    #[serde(default)]
    damping: f64,
    stinger_stiffness: f64,
    #[serde(default)]
    stinger_damping: f64,
    cell_mass: Option<f64>,
    table_mass: Option<f64>,
    resistance: f64,
    #[serde(default)]
    inductance: f64,
    #[serde(rename = "Bl")]
    force_factor: f64,
    #[serde(default)]
    amplifier: Amplifier,
    #[serde(default = "one")]
    gain: f64,
    /// Hz
    cut_off: Option<f64>,
    voltage_max: Option<f64>,
    current_max: Option<f64>,
    stroke_max: Option<f64>,
    force_max: Option<f64>,
}

fn one() -> f64 {
    1.0
}

impl ShakerSection {
    /// Whether it moves a table that carries the structure.
    pub(super) fn has_table(&self) -> bool {
        self.table_mass.is_some()
    }

    /// The structure with the shaker attached.
    pub(super) fn attach(&self, mut structure: Structure) -> Result<Structure, String> {
        let end_mass = match (structure.excitation, self.cell_mass, self.table_mass) {
            (Excitation::Base, None, Some(mass)) => mass,
            (Excitation::Force, mass, None) => mass.unwrap_or(0.0),
            (Excitation::Base, ..) => {
                return Err(
                    "a shaker moves the base of this structure: give `table_mass`, kg, and no `cell_mass`".into(),
                );
            }
            (Excitation::Force, _, Some(_)) => {
                return Err(
                    "`table_mass` belongs to a structure with excitation = \"base\"; a force cell has `cell_mass`, kg"
                        .into(),
                );
            }
        };
        let shaker = Shaker {
            mass: self.mass,
            suspension: [self.stiffness, self.damping],
            stinger: [self.stinger_stiffness, self.stinger_damping],
            end_mass,
            resistance: self.resistance,
            inductance: self.inductance,
            force_factor: self.force_factor,
            amplifier: self.amplifier,
            gain: self.gain,
            cut_off: self.cut_off.map(|hertz| TAU * hertz),
        };
        let limits = Limits {
            voltage: self.voltage_max,
            current: self.current_max,
            stroke: self.stroke_max,
            force: self.force_max,
        };
        for (key, limit, unit) in [
            ("voltage_max", limits.voltage, "V"),
            ("current_max", limits.current, "A"),
            ("stroke_max", limits.stroke, "m"),
            ("force_max", limits.force, "N"),
        ] {
            if let Some(value) = limit.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Err(format!(
                    "{key} = {value} {unit}: a limit must be positive and finite; leave it out for none"
                ));
            }
        }
        if self.amplifier == Amplifier::Current && limits.voltage.is_some() {
            return Err("voltage_max belongs to amplifier = \"voltage\"; an amplifier that controls the current has current_max".into());
        }
        if let Some(point) = structure
            .points
            .iter()
            .find(|point| [ARMATURE, TABLE].contains(&point.as_str()))
        {
            return Err(format!(
                "the structure has a point \"{point}\", which a shaker adds; rename it"
            ));
        }
        let (alone, bare) = (structure.equations.clone(), structure.modes.clone());
        if structure.excitation == Excitation::Force {
            structure.carry(end_mass)?;
        }
        let by = structure.excitation.of_host();
        let equations = shaker.attach(&alone, by).map_err(|error| error.to_string())?;
        let host = equations
            .host(HostExcitation::Force)
            .map_err(|error| error.to_string())?;
        let rows = shaker.rows(&host, &alone, by).map_err(|error| error.to_string())?;
        let beyond = 1 + usize::from(self.has_table());
        let coordinates = |point: usize, beyond: usize| -> Vec<f64> {
            let of_structure: Vec<f64> = match &alone {
                Equations::Modes(_) => bare.iter().map(|mode| mode.shape[point]).collect(),
                _ => (0..structure.points.len())
                    .map(|n| f64::from(u8::from(n == point)))
                    .collect(),
            };
            of_structure.into_iter().chain(vec![0.0; beyond]).collect()
        };
        let points = |host: &Host, beyond: usize| {
            let rows = (0..structure.points.len()).map(|point| host.row(&coordinates(point, beyond)));
            rows.collect::<Result<Vec<_>, _>>().map_err(|error| error.to_string())
        };
        let mut driven = structure.clone();
        if structure.excitation == Excitation::Force {
            driven.equations = alone.carrying(end_mass).map_err(|error| error.to_string())?;
            driven.host = driven.equations.host(by).map_err(|error| error.to_string())?;
            driven.rows = points(&driven.host, 0)?;
        }
        let points = points(&host, beyond)?;
        let omega = structure.mode().omega;
        let mut attached = SceneShaker {
            shaker,
            limits,
            reference_per_command: 0.0,
            rows,
            alone: Box::new(driven),
        };
        let structure = Structure { equations, host, rows: points, ..structure };
        let reference = attached.reference(structure.excitation);
        attached.reference_per_command = structure.host.frequency_response(reference, omega).norm();
        if attached.reference_per_command <= 0.0 {
            return Err("the command does not move the driven mode: check the drive point, and gain and Bl".into());
        }
        Ok(Structure { shaker: Some(attached), ..structure })
    }
}
