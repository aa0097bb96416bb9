//! The `[shaker]` section: an electrodynamic shaker between the command and a structure.

use std::f64::consts::TAU;

use lovines::host::Row;
use lovines::oscillator::Regime;
use lovines::{Amplifier, Plant, Shaker, ShakerRows};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};

use super::structure::{HIGHEST, rows};
use super::{Reference, Structure};
use crate::shaker_path::{BANDWIDTH, ShakerPath, speed};

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
    /// Mass whose inertia is subtracted from what the force cell reads, kg.
    pub compensated_mass: f64,
    /// Its limits.
    pub limits: Limits,
    /// The reference per command at the natural frequency, without impacts: N/V for a force, m/V for a table.
    pub reference_per_command: f64,
    /// Whether the stinger is cut when the drive is released.
    pub release: Release,
    /// What is measured.
    #[serde(skip)]
    pub rows: ShakerRows,
    /// The structure as the reference drives it: with what is left of the mass in front of the force cell.
    #[serde(skip)]
    pub alone: Box<Structure>,
    /// The structure without it.
    #[serde(skip)]
    without: Box<Structure>,
}

/// What happens to the stinger at the release, for the free decay.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Release {
    /// The shaker stays attached: its coil shorted behind an amplifier that controls the voltage, and open behind one that controls the current.
    #[default]
    Attached,
    /// The stinger is cut.
    Cut,
}

/// Limits of a shaker. What the amplifier controls is clipped at its limit; reaching another one ends the experiment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Limits {
    /// Voltage of the coil, V; behind an amplifier that controls the current, what this can supply.
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

    /// What has a limit: its name and the key of the limit in messages, and the channel.
    pub fn limited(&self) -> [(&'static str, &'static str, Channel<'_>); 4] {
        let Self { limits, rows, .. } = self;
        let channel = |name, unit, row, limit| Channel { name, row, per_drive: 0.0, unit, limit, meaning: None };
        let voltage = Channel {
            per_drive: rows.voltage_per_command,
            meaning: Some("voltage of the coil"),
            ..channel("voltage", "V", &rows.voltage, limits.voltage)
        };
        let current = Channel {
            per_drive: rows.current_per_command,
            meaning: Some("current of the coil"),
            ..channel("current", "A", &rows.current, limits.current)
        };
        let force = Channel {
            meaning: Some("force of the stinger on the structure"),
            ..channel("force", "N", &rows.force, limits.force)
        };
        let armature = channel(ARMATURE, "m", &rows.armature, limits.stroke);
        [
            ("voltage", "voltage_max", voltage),
            ("current", "current_max", current),
            ("force", "force_max", force),
            ("displacement of the armature", "stroke_max", armature),
        ]
    }

    /// The reference in the sections of the host: the displacement of the table, or the force of the stinger; and the inertia that is subtracted from
    /// it, per negative acceleration.
    pub(super) fn reference_and_inertia(&self, excitation: Reference) -> [Row; 2] {
        let end = &self.rows.end;
        let inertia = end.iter().map(|pair| pair.map(|value| self.compensated_mass * value));
        match excitation {
            Reference::Base => [end.clone(), vec![[0.0; 2]; end.len()]],
            Reference::Force => [self.rows.force.clone(), inertia.collect()],
        }
    }

    /// The reference of a motion with the frequency `omega`, rad/s, in the sections of the host.
    pub fn reference(&self, excitation: Reference, omega: f64) -> Row {
        let [reference, inertia] = self.reference_and_inertia(excitation);
        let both = reference.iter().zip(&inertia);
        both.map(|(row, inertia)| [0, 1].map(|n| row[n] + omega * omega * inertia[n]))
            .collect()
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
    /// Mass whose inertia is subtracted from what the force cell reads, kg.
    pub fn compensated_mass(&self) -> f64 {
        self.shaker.as_ref().map_or(0.0, |shaker| shaker.compensated_mass)
    }

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
        let Some(shaker) = &self.shaker else {
            return channels;
        };
        if self.excitation == Reference::Base {
            channels.push(point((TABLE, &shaker.rows.end)));
        }
        let [voltage, current, force, armature] = shaker.limited().map(|(.., channel)| channel);
        channels.extend([armature, force, current]);
        // An amplifier that controls the voltage clips it.
        if voltage.limit.is_some() && shaker.shaker.amplifier == Amplifier::Current {
            channels.push(voltage);
        }
        channels
    }

    /// A limit of the shaker that the drive needs more than, in a sentence: `amplitude`, m, of the base or of the oscillator's, at a response at the cavity,
    /// m, that lags by a quarter of a period. The command and a force at the cavity, which the impacts are, make both at the natural frequency.
    pub(super) fn beyond_limits(&self, amplitude: f64, response: f64) -> Option<String> {
        let shaker = self.shaker.as_ref()?;
        let (omega, asked) = (self.mode().omega, self.units().reference.of_metres(amplitude));
        let of = |row: &Row| {
            let by_command = self.host.frequency_response(row, omega);
            [by_command, self.host.frequency_response_to_cavity(row, omega)]
        };
        let alone = &shaker.alone.host;
        let linear = alone.frequency_response(alone.cavity_row(), omega);
        let response = linear * (response / linear.norm());
        let reference = shaker.reference(self.excitation, omega);
        let ([a, b], [c, d]) = (of(&reference), of(self.host.cavity_row()));
        let determinant = a * d - b * c;
        let (command, force) = (
            (asked * d - b * response) / determinant,
            (a * response - c * asked) / determinant,
        );
        let at = |row: &Row| {
            let [by_command, by_force] = of(row);
            by_command * command + by_force * force
        };
        shaker.limited().into_iter().find_map(|(_, key, channel)| {
            let value = (at(channel.row) + channel.per_drive * command).norm();
            let limit = channel.limit.filter(|limit| value > *limit)?;
            Some(format!(
                "[excitation] needs {value:.4} {} at a response of half of the cavity, {:.2} times what shaker.{key} = {limit} allows: lower the drive, \
                 raise the limit, or choose a drive point that moves less",
                channel.unit,
                value / limit
            ))
        })
    }

    /// Force of the shaker on the structure, N, or displacement of its table, m, per volt of its command at a frequency, rad/s, without impacts.
    pub fn reference_by_command(&self, shaker: &SceneShaker, omega: f64) -> Complex64 {
        let reference = shaker.reference(self.excitation, omega);
        self.host.frequency_response(&reference, omega)
    }

    /// Distance of the nearest other pole from the pole of the driven mode after the release, rad/s: of what moves at the sensor, and oscillates.
    pub fn nearest_pole(&self) -> f64 {
        let cut = self.shaker.as_ref().filter(|shaker| shaker.release == Release::Cut);
        let free = cut.map_or(self, |shaker| &*shaker.without);
        let [driven, others @ ..] = &free.poles()[..] else {
            return f64::INFINITY;
        };
        let distances = others.iter().map(|pole| (pole - driven).norm());
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Poles of what oscillates at the sensor, rad/s, the nearest to that of the driven mode first.
    fn poles(&self) -> Vec<Complex64> {
        let sections = self.host.sections().iter().zip(&self.rows[self.sensor]);
        let poles = sections.filter_map(|(section, row)| match section.oscillator.regime {
            Regime::Oscillating { omega_d } if *row != [0.0; 2] => {
                Some(Complex64::new(-section.oscillator.delta, omega_d))
            }
            _ => None,
        });
        let mut poles: Vec<_> = poles.collect();
        let driven = Complex64::new(0.0, self.mode().omega);
        poles.sort_by(|one, other| (one - driven).norm().total_cmp(&(other - driven).norm()));
        poles
    }

    /// Poles of the two modes beside the driven one that ring longest, rad/s.
    pub fn rings(&self) -> [Option<Complex64>; 2] {
        let mut others = self.poles();
        others.drain(..others.len().min(1));
        others.sort_by(|one, other| other.re.total_cmp(&one.re));
        [0, 1].map(|n| others.get(n).copied())
    }

    /// What the shaker makes of its command, from the frequency response at the frequencies of the check.
    pub fn shaker_path(&self) -> Option<ShakerPath> {
        let (shaker, mode) = (self.shaker.as_ref()?, self.mode());
        let (damping_rate, units) = (mode.zeta * mode.omega, self.units());
        let values = frequencies(mode.omega, damping_rate).map(|omega| {
            let value = self.reference_by_command(shaker, omega) / shaker.reference_per_command;
            (omega, value)
        });
        let path = ShakerPath {
            gain: Complex64::ONE,
            pole: Complex64::ONE,
            damping_rate,
            largest: units.command.in_metres(shaker.largest_command()),
            speed: 1.0,
            aliased: 0.0,
        };
        let path = path.fitted(mode.omega, damping_rate, &values);
        let response = self.response();
        let per_command = units.response.in_metres(units.command.of_metres(1.0));
        let exact = |omega: f64| {
            let reference = self.reference_by_command(shaker, omega) / shaker.reference_per_command;
            [reference, self.host.frequency_response(&response, omega) * per_command]
        };
        let speed = speed(&path, mode.omega, exact);
        Some(ShakerPath { speed, ..path })
    }
}

/// Places of the frequencies about the natural one, half-power bandwidths.
pub const PLACES: [f64; 7] = [-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0];

/// Frequencies at which a shaker is measured, rad/s: at [`PLACES`], and at the bandwidth of its control to each side.
pub fn frequencies(omega0: f64, damping_rate: f64) -> [f64; 9] {
    let sides = [1.0 - BANDWIDTH, 1.0 + BANDWIDTH];
    std::array::from_fn(|n| match PLACES.get(n) {
        Some(place) => omega0 + 2.0 * place * damping_rate,
        None => omega0 * sides[n - PLACES.len()],
    })
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
    #[serde(default)]
    compensated_mass: f64,
    /// Of the table that it moves, which carries the structure.
    pub(super) table_mass: Option<f64>,
    resistance: f64,
    #[serde(default)]
    inductance: f64,
    #[serde(rename = "Bl")]
    force_factor: f64,
    #[serde(default)]
    amplifier: Amplifier,
    /// 1 if it is left out.
    gain: Option<f64>,
    /// Hz
    cut_off: Option<f64>,
    voltage_max: Option<f64>,
    current_max: Option<f64>,
    stroke_max: Option<f64>,
    force_max: Option<f64>,
    #[serde(default)]
    release: Release,
}

impl ShakerSection {
    /// The structure with the shaker attached.
    pub(super) fn attach(&self, structure: Structure) -> Result<Structure, String> {
        let end_mass = match (structure.excitation, self.cell_mass, self.table_mass) {
            (Reference::Base, None, Some(mass)) => mass,
            (Reference::Force, mass, None) => mass.unwrap_or(0.0),
            (Reference::Base, ..) => {
                return Err(
                    "a shaker moves the base of this structure: give `table_mass`, kg, and no `cell_mass`".into(),
                );
            }
            (Reference::Force, _, Some(_)) => {
                return Err(
                    "`table_mass` belongs to a structure with excitation = \"base\"; a force cell has `cell_mass`, kg"
                        .into(),
                );
            }
        };
        if let Some(cut_off) = self.cut_off.filter(|hertz| !(*hertz > 0.0 && *hertz <= HIGHEST)) {
            return Err(format!(
                "cut_off = {cut_off} Hz: it must be positive and at most {HIGHEST:e}; leave it out for an amplifier that follows at once"
            ));
        }
        let compensated = self.compensated_mass;
        if !(compensated >= 0.0 && compensated.is_finite()) || compensated > 0.0 && self.table_mass.is_some() {
            return Err(format!(
                "compensated_mass = {compensated} kg: the mass that is compensated behind a force cell, 0 or positive; a table has none"
            ));
        }
        let shaker = Shaker {
            mass: self.mass,
            suspension: [self.stiffness, self.damping],
            stinger: [self.stinger_stiffness, self.stinger_damping],
            end_mass,
            resistance: self.resistance,
            inductance: self.inductance,
            force_factor: self.force_factor,
            amplifier: self.amplifier,
            gain: self.gain.unwrap_or(1.0),
            cut_off: self.cut_off.map(|hertz| TAU * hertz),
        };
        let limits = Limits {
            voltage: self.voltage_max,
            current: self.current_max,
            stroke: self.stroke_max,
            force: self.force_max,
        };
        if self.amplifier == Amplifier::Current
            && limits.voltage.is_some()
            && self.inductance > 0.0
            && self.cut_off.is_none()
        {
            return Err("voltage_max of an amplifier that controls the current through an inductance needs its `cut_off`, Hz: without it the current jumps".into());
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
        let structure = structure.with_shaker(shaker, compensated, limits, self.release)?;
        let attached = structure.shaker.as_ref();
        let moving = attached.filter(|attached| attached.reference_per_command > 0.0);
        let moving =
            moving.ok_or("the command does not move the driven mode: check the drive point, and gain and Bl")?;
        for (_, key, Channel { limit, unit, .. }) in moving.limited() {
            if let Some(value) = limit.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Err(format!(
                    "{key} = {value} {unit}: a limit must be positive and finite; leave it out for none"
                ));
            }
        }
        Ok(structure)
    }
}

/// Stiffness that is left of a stinger that is cut, over the whole: a host needs a stiffness.
const CUT: f64 = 1e-9;

impl Structure {
    /// This structure with a shaker attached.
    fn with_shaker(
        mut self,
        shaker: Shaker,
        compensated_mass: f64,
        limits: Limits,
        release: Release,
    ) -> Result<Self, String> {
        let text = |error: lovines::InvalidHost| error.to_string();
        let without = Box::new(self.clone());
        let by = self.excitation.excitation();
        let equations = shaker.attach(&without.equations, by).map_err(text)?;
        // What a force cell does not compensate belongs to the structure.
        let in_front = self.drive.map(|drive| (drive, shaker.end_mass - compensated_mass));
        let in_front = in_front.filter(|(_, mass)| *mass != 0.0);
        if let Some((drive, mass)) = in_front {
            self.carry(drive, mass).map_err(|error| {
                format!("compensated_mass = {compensated_mass} kg leaves {mass} kg in front of the force cell: {error}")
            })?;
        }
        let host = equations.host(lovines::Excitation::Force).map_err(text)?;
        let of_shaker = shaker.rows(&host, &without.equations, by).map_err(text)?;
        let beyond = vec![0.0; rows_beyond(self.excitation)];
        let coordinates = self.coordinates.iter().map(|point| [&point[..], &beyond].concat());
        let points = rows(&host, &coordinates.collect::<Vec<_>>())?;
        let mut driven = self.clone();
        if let Some((_, mass)) = in_front {
            driven.equations = without.equations.carrying(mass).map_err(text)?;
            driven.host = driven.equations.host(by).map_err(text)?;
            driven.rows = rows(&driven.host, &self.coordinates)?;
        }
        let omega = self.mode().omega;
        let mut attached = SceneShaker {
            shaker,
            compensated_mass,
            limits,
            reference_per_command: 0.0,
            release,
            rows: of_shaker,
            without,
            alone: Box::new(driven),
        };
        let structure = Self { equations, host, rows: points, ..self };
        attached.reference_per_command = structure.reference_by_command(&attached, omega).norm();
        Ok(Self { shaker: Some(attached), ..structure })
    }

    /// This structure after its stinger has broken; it has the same coordinates.
    pub fn with_broken_stinger(&self) -> Option<Result<Self, String>> {
        let SceneShaker { shaker, compensated_mass, limits, release, without, .. } = self.shaker.as_ref()?;
        let stinger = [CUT * shaker.stinger[0], 0.0];
        let broken = (**without).clone();
        Some(broken.with_shaker(Shaker { stinger, ..*shaker }, *compensated_mass, *limits, *release))
    }

    /// The displacements of all coordinates of a structure with a shaker, by the sections.
    pub fn coordinates_with_shaker(&self) -> Result<Vec<Row>, String> {
        let n = self.modes.len() + rows_beyond(self.excitation);
        let coordinate = |place: usize| (0..n).map(|other| f64::from(u8::from(other == place))).collect();
        rows(&self.host, &(0..n).map(coordinate).collect::<Vec<_>>())
    }
}

/// Coordinates of a structure with a shaker beside its own: the table, and the stretch of the stinger.
fn rows_beyond(excitation: Reference) -> usize {
    1 + usize::from(excitation == Reference::Base)
}
