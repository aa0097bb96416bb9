//! The `[structure]` section: a host with several modes instead of the oscillator M, k, c, by modes, by matrices or by poles and residues.

mod files;

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use lovines::host::{Equations, Row, natural_modes};
use lovines::oscillator::Oscillator;
use lovines::{Host, Mode, Section};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use vines_model::numerics::mean_square;

use super::shaker::SceneShaker;
use super::{Reference, SceneError};
use crate::units::{Unit, Units};
use files::{Matrix, Residues};

/// A mode of a structure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StructureMode {
    /// Natural frequency, rad/s.
    pub omega: f64,
    /// Damping ratio.
    pub zeta: f64,
    /// Mass-normalised shape at the points, 1/sqrt(kg), in their order. Of a complex mode the part in phase.
    pub shape: Vec<f64>,
    /// Share of a measured shape that is out of phase and left out: its norm over the norm of the whole shape.
    pub out_of_phase: f64,
    /// Participation of the base, sqrt(kg), or the shape at the force's point, 1/sqrt(kg).
    pub drive: f64,
}

/// A structure: its equations, its points, what drives it and what is measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Structure {
    /// What drives it, by itself or behind a shaker: the displacement of its base, or a force at a point.
    pub excitation: Reference,
    /// Names of the points.
    pub points: Vec<String>,
    /// The point of the cavity, by its place among the points.
    pub cavity: usize,
    /// The point of the force.
    pub drive: Option<usize>,
    /// The point of the sensor.
    pub sensor: usize,
    /// The driven mode, by its place among the modes.
    pub driven: usize,
    /// The modes by rising frequency.
    pub modes: Vec<StructureMode>,
    /// What the host is made of.
    #[serde(skip)]
    pub equations: Equations,
    /// The structure as plant and exact orbits take it.
    #[serde(skip)]
    pub host: Host,
    /// Every point in the coordinates of these equations.
    #[serde(skip)]
    pub(super) coordinates: Vec<Vec<f64>>,
    /// The displacement of every point in the sections of the host.
    #[serde(skip)]
    pub rows: Vec<Row>,
    /// Masses, kg, of what is mounted at points, by their places among the points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub masses: Vec<(usize, f64)>,
    /// Natural frequencies without these masses, rad/s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub omega_without_masses: Vec<f64>,
    /// The shaker that moves it, as a part of the host.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaker: Option<SceneShaker>,
}

impl Structure {
    /// The section of the scene that makes it more than one oscillator.
    pub fn section(&self) -> &'static str {
        match &self.shaker {
            Some(_) if self.modes.len() == 1 => "[shaker]",
            _ => "[structure]",
        }
    }

    /// The driven mode.
    pub fn mode(&self) -> &StructureMode {
        &self.modes[self.driven]
    }

    /// Shape of a mode at the cavity, 1/sqrt(kg).
    pub(crate) fn at_cavity(&self, mode: &StructureMode) -> f64 {
        mode.shape[self.cavity]
    }

    /// The displacement that the response is, in the sections of the host: at the sensor, in its [`Self::direction`].
    pub fn response(&self) -> Row {
        let sign = self.direction();
        self.rows[self.sensor]
            .iter()
            .map(|pair| pair.map(|value| sign * value))
            .collect()
    }

    /// Refuses a cavity where the mass ratio of the driven mode with a particle of the mass `m`, kg, is rounding.
    pub(super) fn reached_by(&self, m: f64) -> Result<(), String> {
        let (mode, ratio) = (self.mode(), self.mass_ratio(self.mode(), m));
        if ratio > FILE_ROUNDING {
            return Ok(());
        }
        Err(format!(
            "the cavity at {} is at a node of the driven mode {} by rising frequency ({:.6} Hz): its shape there, {:.4e} 1/sqrt(kg), makes the mass ratio \
             m phi² = {ratio:.1e}, and above {FILE_ROUNDING:e} a particle can act on it; choose another point or mode, or check the unit of the shape",
            self.points[self.cavity],
            self.driven + 1,
            mode.omega / TAU,
            self.at_cavity(mode)
        ))
    }

    /// Modal mass ratio `m phi_n²` of a mode for the particle mass `m`, kg.
    pub fn mass_ratio(&self, mode: &StructureMode, m: f64) -> f64 {
        m * self.at_cavity(mode).powi(2)
    }

    /// A structure with one mode at one point, which is driven by its base or by a force there.
    pub(super) fn of_oscillator(
        [mass, stiffness, damping]: [f64; 3],
        excitation: Reference,
    ) -> Result<Self, SceneError> {
        let (omega, shape) = ((stiffness / mass).sqrt(), mass.sqrt().recip());
        let drive = match excitation {
            Reference::Base => mass.sqrt(),
            Reference::Force => shape,
        };
        let mode = StructureMode {
            omega,
            zeta: 0.5 * damping / (mass * omega),
            shape: vec![shape],
            out_of_phase: 0.0,
            drive,
        };
        let place = (excitation == Reference::Force).then_some(0);
        let at = Places { cavity: 0, drive: place, sensor: 0 };
        let parts = Parts {
            points: vec!["mass".to_owned()],
            modes: vec![mode],
            coupled: None,
        };
        Self::of_parts(excitation, parts, at, 0).map_err(|message| SceneError::text("[plant]", message))
    }

    /// The structure of these modes, or of the matrices where the damping couples them.
    fn of_parts(excitation: Reference, parts: Parts, at: Places, driven: usize) -> Result<Self, String> {
        let Parts { points, modes, coupled } = parts;
        check(&points, &modes, driven, &at)?;
        let (equations, coordinates) = equations(&modes, coupled.as_ref(), &at, points.len());
        let host = equations
            .host(excitation.excitation())
            .map_err(|error| error.to_string())?;
        let rows = rows(&host, &coordinates)?;
        let Places { cavity, drive, sensor } = at;
        Ok(Self {
            excitation,
            points,
            cavity,
            drive,
            sensor,
            driven,
            modes,
            equations,
            host,
            coordinates,
            rows,
            masses: Vec::new(),
            omega_without_masses: Vec::new(),
            shaker: None,
        })
    }

    /// The modes with a mass, kg, at a point: what a force cell behind that mass sees.
    pub(super) fn carry(&mut self, point: usize, mass: f64) -> Result<(), String> {
        let parts = Parts {
            points: self.points.clone(),
            modes: self.modes.clone(),
            coupled: None,
        };
        if self.masses.is_empty() {
            self.omega_without_masses = self.modes.iter().map(|mode| mode.omega).collect();
        }
        self.modes = parts.loaded(&[(point, mass)])?.modes;
        self.modes.iter_mut().for_each(|mode| mode.drive = mode.shape[point]);
        self.masses.push((point, mass));
        Ok(())
    }

    /// What the masses at its points do to its modes, in a sentence; `None` without masses.
    pub fn mass_loading(&self) -> Option<String> {
        let masses = self
            .masses
            .iter()
            // A difference of two masses has rounding.
            .map(|(point, mass)| format!("{} kg at {}", (1e9 * mass).round() / 1e9, self.points[*point]));
        let lower = self.modes.iter().zip(&self.omega_without_masses);
        let lower = lower.map(|(mode, without)| format!("{:.3}", 100.0 * (1.0 - mode.omega / without)));
        let [masses, lower] = [masses.collect::<Vec<_>>(), lower.collect()].map(|parts| parts.join(", "));
        (!masses.is_empty()).then(|| format!("masses mounted ({masses}) lower the modes by {lower} %"))
    }

    /// The units of its channels, in metres of the driven mode's oscillator: a drive is the displacement of the base that moves it alike, and a
    /// response its displacement.
    pub fn units(&self) -> Units {
        let mode = self.mode();
        let per_stiffness = match self.excitation {
            Reference::Base => 1.0,
            Reference::Force => mode.omega.powi(-2) / Reference::Force.per_base(2.0 * mode.zeta),
        };
        let base = (self.at_cavity(mode) * mode.drive).abs() * per_stiffness;
        let reference = Unit::of(self.excitation.unit(), base);
        Units {
            command: match &self.shaker {
                Some(shaker) => Unit::of("V", base * shaker.reference_per_command),
                None => reference,
            },
            reference,
            response: Unit::per_metre("m", (mode.shape[self.sensor] / self.at_cavity(mode)).abs()),
        }
    }

    /// The sign of the displacement at the sensor that is the response: in resonance it lags the drive, wherever cavity, drive and sensor are.
    pub fn direction(&self) -> f64 {
        let mode = self.mode();
        (mode.shape[self.sensor] * mode.drive).signum()
    }

    /// All sections, and the driven mode with the opposite sign, each with the weights of its state in the response: per displacement of the base that
    /// moves the driven mode's oscillator, and per displacement of the latter.
    pub fn beside_driven_mode(&self) -> Vec<(Section, [f64; 2])> {
        let mode = self.mode();
        let (square, damping) = (mode.omega * mode.omega, 2.0 * mode.zeta * mode.omega);
        let drive = match self.excitation {
            Reference::Base => [square, damping],
            Reference::Force => [square * Reference::Force.per_base(2.0 * mode.zeta), 0.0],
        };
        let alone = Section {
            oscillator: Oscillator::new(1.0, square, damping),
            drive,
            kick: [0.0; 2],
            cavity: [0.0; 2],
        };
        let Units { reference, response, .. } = self.units();
        let in_metres = |weight: f64| response.in_metres(reference.of_metres(weight));
        let rows = self.response().into_iter().map(|pair| pair.map(in_metres));
        let sections = self.host.sections().iter().copied().zip(rows);
        sections.chain([(alone, [-1.0, 0.0])]).collect()
    }
}

// The section as written.

/// The section `[structure]`.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct StructureSection {
    excitation: Reference,
    cavity: Option<String>,
    drive: Option<String>,
    sensor: Option<String>,
    /// Number of the driven mode, from 1.
    mode: Option<usize>,
    modes: Vec<ModeSection>,
    #[serde(rename = "M")]
    m: Option<PathBuf>,
    #[serde(rename = "C")]
    c: Option<PathBuf>,
    #[serde(rename = "K")]
    k: Option<PathBuf>,
    direction: Option<BTreeMap<String, f64>>,
    residues: Option<PathBuf>,
    reference: Option<String>,
    /// Masses at points, kg.
    masses: BTreeMap<String, f64>,
}

/// A mode as written.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModeSection {
    /// Hz
    frequency: f64,
    /// Damping ratio.
    damping: f64,
    shape: BTreeMap<String, f64>,
    participation: Option<f64>,
}

/// Modes with their points, before places and signs are checked.
struct Parts {
    points: Vec<String>,
    modes: Vec<StructureMode>,
    /// Where the damping couples the modes.
    coupled: Option<Coupled>,
}

/// A structure by M, C and K.
struct Coupled {
    matrices: [DMatrix<f64>; 3],
    /// Displacement of its coordinates with the base.
    direction: DVector<f64>,
    /// Displacements of the points, line by line, per coordinate.
    coordinates: DMatrix<f64>,
}

impl Coupled {
    /// A structure whose points are its degrees of freedom.
    fn of_points(matrices: [DMatrix<f64>; 3], direction: DVector<f64>) -> Self {
        let n = direction.len();
        Self { matrices, direction, coordinates: DMatrix::identity(n, n) }
    }
}

impl Parts {
    /// The modes of M, C and K without the coupling by the damping, and the matrices where there is a coupling.
    fn of_matrices(points: Vec<String>, coupled: Coupled) -> Result<Self, String> {
        let Coupled { matrices: [m, c, k], direction, coordinates } = &coupled;
        let (shapes, squares) = natural_modes(m, k).map_err(|error| error.to_string())?;
        let damping = shapes.transpose() * c * &shapes;
        let base = shapes.transpose() * m * direction;
        let at_points = coordinates * &shapes;
        let modes = squares.iter().enumerate().map(|(n, square)| {
            let omega = square.sqrt();
            StructureMode {
                omega,
                zeta: 0.5 * damping[(n, n)] / omega,
                shape: at_points.column(n).iter().copied().collect(),
                out_of_phase: 0.0,
                drive: base[n],
            }
        });
        let modes: Vec<StructureMode> = modes.collect();
        // The coupling of two modes by the damper, over what dampens them.
        let largest = damping.diagonal().amax();
        let is_modal = damping
            .iter()
            .enumerate()
            .all(|(n, value)| n % (modes.len() + 1) == 0 || value.abs() <= FILE_ROUNDING * largest);
        Ok(Self { points, modes, coupled: (!is_modal).then_some(coupled) })
    }

    /// These with masses, kg, at points. What the springs do to the structure is as before, also what they do with the base.
    fn loaded(self, masses: &[(usize, f64)]) -> Result<Self, String> {
        let Self { points, modes, coupled } = self;
        if masses.is_empty() {
            return Ok(Self { points, modes, coupled });
        }
        // Without matrices the coordinates are the modes.
        let modal = || {
            let diagonal = |of: fn(&StructureMode) -> f64| {
                DMatrix::from_diagonal(&DVector::from_iterator(modes.len(), modes.iter().map(of)))
            };
            let matrices = [
                diagonal(|_| 1.0),
                diagonal(|mode| 2.0 * mode.zeta * mode.omega),
                diagonal(|mode| mode.omega * mode.omega),
            ];
            Coupled {
                matrices,
                direction: DVector::from_iterator(modes.len(), modes.iter().map(|mode| mode.drive)),
                coordinates: DMatrix::from_fn(points.len(), modes.len(), |point, n| modes[n].shape[point]),
            }
        };
        let mut coupled = coupled.unwrap_or_else(modal);
        for (point, mass) in masses {
            let row = coupled.coordinates.row(*point);
            coupled.matrices[0] += *mass * row.transpose() * row;
        }
        let mut loaded = Self::of_matrices(points, coupled)?;
        for (mode, old) in loaded.modes.iter_mut().zip(&modes) {
            mode.out_of_phase = old.out_of_phase;
        }
        Ok(loaded)
    }
}

/// Largest relative difference of a matrix from its transpose, and share of a shape at a node: rounding of what a file states to nine digits.
const FILE_ROUNDING: f64 = 1e-9;
/// Largest difference of the norm of a mass-normalised shape from 1: shapes are measured, or written to three digits.
const NORM: f64 = 0.02;

/// Highest frequency, Hz: the plant takes 1e12 rad/s.
pub(super) const HIGHEST: f64 = 1e11;

impl StructureSection {
    /// The structure; paths are relative to `folder`.
    pub(super) fn resolve(self, origin: &str, folder: &Path) -> Result<Structure, SceneError> {
        self.checked(folder)
            .map_err(|message| SceneError::text(origin, format!("[structure]: {message}")))
    }

    fn checked(self, folder: &Path) -> Result<Structure, String> {
        let parts = self.parts(folder)?;
        let at = self.places(&parts.points)?;
        let masses = self.mounted(&parts.points)?;
        let omega_without_masses = match masses.is_empty() {
            true => Vec::new(),
            false => parts.modes.iter().map(|mode| mode.omega).collect(),
        };
        let mut parts = parts.loaded(&masses)?;
        if let Some(drive) = at.drive {
            parts.modes.iter_mut().for_each(|mode| mode.drive = mode.shape[drive]);
        }
        let driven = self.mode.unwrap_or(1);
        if !(1..=parts.modes.len()).contains(&driven) {
            return Err(format!(
                "mode = {driven}: the structure has the modes 1 to {}",
                parts.modes.len()
            ));
        }
        let structure = Structure::of_parts(self.excitation, parts, at, driven - 1)?;
        Ok(Structure { masses, omega_without_masses, ..structure })
    }

    /// Points and modes, by the one description that is given.
    fn parts(&self, folder: &Path) -> Result<Parts, String> {
        let forms = [
            !self.modes.is_empty(),
            self.c.is_some() || self.k.is_some(),
            self.residues.is_some(),
        ];
        match forms {
            [true, false, false] => self.of_modes(folder),
            [false, true, false] => self.of_matrices(folder),
            [false, false, true] => self.of_residues(folder),
            _ => Err(
                "give exactly one description: `modes`, the matrices `M`, `C` and `K`, or `residues` (one oscillator is [plant], and what is mounted on it \
                 belongs to its M)"
                    .into(),
            ),
        }
    }

    /// Where cavity, force and sensor are.
    fn places(&self, points: &[String]) -> Result<Places, String> {
        let required = |key: &str, name: &Option<String>| match name {
            Some(name) => place(points, key, name),
            None => Err(format!(
                "`{key}` is missing: give one of the points {}",
                points.join(", ")
            )),
        };
        let cavity = required("cavity", &self.cavity)?;
        let drive = match (self.excitation, &self.drive) {
            (Reference::Force, name) => Some(required("drive", name)?),
            (Reference::Base, None) => None,
            (Reference::Base, Some(name)) => {
                return Err(format!(
                    "drive = \"{name}\" with excitation = \"base\": a base moves all supports; drop it, or take excitation = \"force\""
                ));
            }
        };
        let sensor = self
            .sensor
            .as_ref()
            .map(|name| place(points, "sensor", name))
            .transpose()?;
        let sensor = sensor.or(drive).unwrap_or(cavity);
        Ok(Places { cavity, drive, sensor })
    }

    /// The masses, kg, and the places of their points.
    fn mounted(&self, points: &[String]) -> Result<Vec<(usize, f64)>, String> {
        let mounted = |(name, mass): (&String, &f64)| match *mass {
            mass if mass > 0.0 && mass.is_finite() => Ok((place(points, "masses", name)?, mass)),
            mass => Err(format!(
                "masses has {mass} kg at {name}; a mass mounted on a point must be positive and finite"
            )),
        };
        self.masses.iter().map(mounted).collect()
    }

    /// The modes of a table.
    fn of_modes(&self, folder: &Path) -> Result<Parts, String> {
        let points: Vec<String> = self.modes[0].shape.keys().cloned().collect();
        self.only_with("residues", "reference", self.reference.is_some())?;
        let mass = self
            .m
            .as_ref()
            .map(|file| Matrix::read(folder, "M", file))
            .transpose()?;
        match &mass {
            None => self.only_with("M", "direction", self.direction.is_some())?,
            Some(mass) => mass.symmetric().and_then(|()| mass.heavy())?,
        }
        let mut modes = Vec::new();
        for (n, mode) in self.modes.iter().enumerate() {
            let number = n + 1;
            let ModeSection { frequency, damping, shape, participation } = mode;
            if !(*frequency > 0.0 && *frequency <= HIGHEST) {
                return Err(format!(
                    "mode {number} has frequency = {frequency} Hz: it must be positive and at most {HIGHEST:e} Hz; leave out rigid-body modes (0 Hz)"
                ));
            }
            if !(*damping >= 0.0 && *damping < 1.0) {
                return Err(format!(
                    "mode {number} ({frequency} Hz) has damping = {damping}: the damping ratio must be at least 0 and below 1, because a mode must oscillate \
                     (it is a number, not per cent)"
                ));
            }
            let shapes = shape
                .iter()
                .map(|(point, value)| (format!("the shape at {point}"), *value));
            let numbers = shapes.chain(participation.map(|value| ("participation".to_owned(), value)));
            for (name, value) in numbers {
                if !value.is_finite() {
                    return Err(format!(
                        "mode {number} ({frequency} Hz) has {name} = {value}: it must be a finite number, mass-normalised"
                    ));
                }
            }
            if shape.len() != points.len() || !shape.keys().eq(points.iter()) {
                let own: Vec<&str> = shape.keys().map(String::as_str).collect();
                return Err(format!(
                    "mode {number} has its shape at the points {}, and mode 1 at {}: all need the same points",
                    own.join(", "),
                    points.join(", ")
                ));
            }
            let shape: Vec<f64> = shape.values().copied().collect();
            let by_mass = mass.as_ref().map(|mass| self.by_mass(mass, number, &points, &shape));
            let by_mass = by_mass.transpose()?;
            let drive = match (self.excitation, participation) {
                (Reference::Force, None) => 0.0,
                (Reference::Force, Some(_)) => {
                    return Err(format!(
                        "mode {number} has a participation, which belongs to excitation = \"base\": a force acts by the shape at its point"
                    ));
                }
                (Reference::Base, given) => given.or(by_mass).ok_or_else(|| {
                    format!(
                        "mode {number} has no participation of the base: give `participation` in sqrt(kg), or `M`, from which it follows"
                    )
                })?,
            };
            modes.push(StructureMode {
                omega: TAU * frequency,
                zeta: *damping,
                shape,
                out_of_phase: 0.0,
                drive,
            });
        }
        modes.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        Ok(Parts { points, modes, coupled: None })
    }

    /// Participation of the base in a mode, by the matrix M; refuses a shape that is not mass-normalised.
    fn by_mass(&self, mass: &Matrix, number: usize, points: &[String], shape: &[f64]) -> Result<f64, String> {
        let place = |name: &String| {
            points.iter().position(|point| point == name).ok_or_else(|| {
                format!(
                    "mode {number} has no shape at {name}, a degree of freedom of M; its points are {}",
                    points.join(", ")
                )
            })
        };
        let places = mass.names.iter().map(place).collect::<Result<Vec<_>, _>>()?;
        let shape = DVector::from_iterator(places.len(), places.iter().map(|&n| shape[n]));
        let norm = shape.dot(&(&mass.values * &shape)).sqrt();
        if (norm - 1.0).abs() > NORM {
            return Err(format!(
                "the shape of mode {number} is not mass-normalised: the norm sqrt(phi' M phi) is {norm:.4}, not 1; divide the shape by it"
            ));
        }
        Ok(shape.dot(&(&mass.values * self.direction(&mass.names)?)))
    }

    /// Displacement of the degrees of freedom where the base moves by one: 1 unless the section says otherwise.
    fn direction(&self, names: &[String]) -> Result<DVector<f64>, String> {
        let Some(given) = &self.direction else {
            return Ok(DVector::from_element(names.len(), 1.0));
        };
        if let Some(unknown) = given.keys().find(|key| !names.contains(key)) {
            return Err(format!(
                "direction has {unknown}, which is no degree of freedom; these are {}",
                names.join(", ")
            ));
        }
        let value = |name: &String| given.get(name).copied().unwrap_or(0.0);
        Ok(DVector::from_iterator(names.len(), names.iter().map(value)))
    }

    /// The modes of M, C and K.
    fn of_matrices(&self, folder: &Path) -> Result<Parts, String> {
        self.only_with("residues", "reference", self.reference.is_some())?;
        let read = |key: &str, file: &Option<PathBuf>| match file {
            Some(file) => Matrix::read(folder, key, file),
            None => Err(format!(
                "`{key}` is missing: a structure by matrices needs M, C and K, each as a CSV file"
            )),
        };
        let [m, c, k] = [read("M", &self.m)?, read("C", &self.c)?, read("K", &self.k)?];
        for other in [&c, &k] {
            if other.names != m.names {
                return Err(format!(
                    "{} has the degrees of freedom {}, and {} has {}: all matrices need the same, in the same order",
                    m.title,
                    m.names.join(", "),
                    other.title,
                    other.names.join(", ")
                ));
            }
        }
        for matrix in [&m, &c, &k] {
            matrix.symmetric()?;
        }
        m.heavy()?;
        k.stiff()?;
        c.damped()?;
        let direction = self.direction(&m.names)?;
        Parts::of_matrices(m.names, Coupled::of_points([m.values, c.values, k.values], direction))
    }

    /// The modes of a table of poles and residues.
    fn of_residues(&self, folder: &Path) -> Result<Parts, String> {
        self.only_with("M or M, C and K", "direction", self.direction.is_some())?;
        self.only_with("modes or C and K", "M", self.m.is_some())?;
        if self.excitation == Reference::Base {
            return Err(
                "residues of a receptance belong to excitation = \"force\": what a base does follows from modes with a participation, or from M, \
                 C and K"
                    .into(),
            );
        }
        let file = self.residues.as_deref().unwrap_or(Path::new(""));
        let residues = Residues::read(folder, file, self.reference.as_deref())?;
        if let Some(matrices) = residues.matrices() {
            let n = residues.points.len();
            return Parts::of_matrices(residues.points, Coupled::of_points(matrices, DVector::zeros(n)));
        }
        let Residues { points, poles } = residues;
        let square = |shape: &[Complex64], of: fn(Complex64) -> f64| mean_square(shape.iter().copied().map(of));
        let modes = poles.iter().map(|(pole, shape)| StructureMode {
            omega: pole.norm(),
            zeta: -pole.re / pole.norm(),
            shape: shape.iter().map(|value| value.re).collect(),
            out_of_phase: (square(shape, |value| value.im) / square(shape, Complex64::norm)).sqrt(),
            drive: 0.0,
        });
        let modes = modes.collect();
        Ok(Parts { points, modes, coupled: None })
    }

    fn only_with(&self, owner: &str, key: &str, is_given: bool) -> Result<(), String> {
        match is_given {
            true => Err(format!("`{key}` belongs to a structure by {owner}; drop it")),
            false => Ok(()),
        }
    }
}

/// Places of cavity, force and sensor among the points.
struct Places {
    cavity: usize,
    drive: Option<usize>,
    sensor: usize,
}

/// The place of a point among the points; `key` names it in messages.
fn place(points: &[String], key: &str, name: &str) -> Result<usize, String> {
    points.iter().position(|point| point == name).ok_or_else(|| {
        format!(
            "{key} = \"{name}\" is no point of the structure; its points are {}",
            points.join(", ")
        )
    })
}

/// Refuses a driven mode that no impact or drive can reach, that the sensor does not see, or that does not oscillate.
fn check(points: &[String], modes: &[StructureMode], driven: usize, at: &Places) -> Result<(), String> {
    for (n, mode) in modes.iter().enumerate() {
        if mode.zeta >= 1.0 {
            return Err(format!(
                "mode {} by rising frequency ({:.6} Hz) has the damping ratio {}: critical or more, and a mode must oscillate; the ratio must be below 1",
                n + 1,
                mode.omega / TAU,
                mode.zeta
            ));
        }
    }
    let mode = &modes[driven];
    let number = format!("{} by rising frequency ({:.6} Hz)", driven + 1, mode.omega / TAU);
    if let Some(n) = mode.shape.iter().position(|value| !value.is_finite()) {
        return Err(format!(
            "mode {number} has the shape {} at {}: it must be a finite number",
            mode.shape[n], points[n]
        ));
    }
    let largest = mode
        .shape
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let is_node = |point: usize| mode.shape[point].abs() <= FILE_ROUNDING * largest;
    if at.drive.map_or(mode.drive == 0.0, is_node) {
        let place = at
            .drive
            .map_or("the base".into(), |point| format!("the force at {}", points[point]));
        return Err(format!(
            "{place} does not drive mode {number}: its shape or participation there is 0; choose another point or mode"
        ));
    }
    for (what, point, effect) in [
        ("cavity", at.cavity, "no impact can drive it"),
        ("sensor", at.sensor, "no motion of it is read"),
    ] {
        if is_node(point) {
            return Err(format!(
                "the {what} at {} is at a node of the driven mode {number}, whose shape there is {:e} of its largest: {effect}; choose another point or \
                 mode",
                points[point],
                mode.shape[point].abs() / largest
            ));
        }
    }
    Ok(())
}

/// The equations of the host, which are real modes, or the matrices where the damping couples these; and its points in their coordinates.
fn equations(
    modes: &[StructureMode],
    coupled: Option<&Coupled>,
    at: &Places,
    points: usize,
) -> (Equations, Vec<Vec<f64>>) {
    let Some(Coupled { matrices, direction, coordinates }) = coupled else {
        let mode = |mode: &StructureMode| Mode {
            omega: mode.omega,
            zeta: mode.zeta,
            cavity: mode.shape[at.cavity],
            drive: mode.drive,
        };
        let shapes = |point: usize| modes.iter().map(|mode| mode.shape[point]).collect();
        return (
            Equations::Modes(modes.iter().map(mode).collect()),
            (0..points).map(shapes).collect(),
        );
    };
    let rows = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    let ([mass, damping, stiffness], coordinates) = (matrices.each_ref().map(rows), rows(coordinates));
    let equations = Equations::Matrices {
        mass,
        damping,
        stiffness,
        cavity: coordinates[at.cavity].clone(),
        drive: at.drive.map_or_else(
            || direction.iter().copied().collect(),
            |point| coordinates[point].clone(),
        ),
        states: Vec::new(),
    };
    (equations, coordinates)
}

/// The displacements of points in the sections of a host.
pub(super) fn rows(host: &Host, coordinates: &[Vec<f64>]) -> Result<Vec<Row>, String> {
    let rows = coordinates.iter().map(|point| host.row(point));
    rows.collect::<Result<_, _>>().map_err(|error| error.to_string())
}
