//! An electrodynamic shaker: armature, suspension, stinger, coil and amplifier, as further degrees of freedom of a structure.
//!
//! ```text
//! m x'' + c x' + k x = Bl i - P,    P = ks (x - y) + cs (x' - y')
//! voltage:  L i' + R i + Bl x' = V,    V' = wc (g u - V)
//! current:  i' = wc (g u - i)
//! ```
//!
//! `x` is the displacement of the armature, `y` of the structure's end of the stinger, `P` the force of the stinger on the structure, and `u`
//! the command. Without inductance `i = (V - Bl x')/R`, and without a cut-off `wc` the amplifier follows at once. The whole is a
//! [`Host`](crate::Host) whose drive is the command, and as exact as a structure alone.

use nalgebra::{DMatrix, DVector};

use crate::base_motion::{BaseMotion, Drive, shift};
use crate::host::{Equations, Excitation, FirstOrderState, Host, InvalidHost, Row};
use crate::parameters::{FASTEST, InvalidValue};
use crate::plant::Plant;
use crate::structure::{Structure, drive_derivatives};

/// A shaker.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Shaker {
    /// Moving mass of the armature, kg.
    pub mass: f64,
    /// Stiffness (N/m) and damping (N s/m) of its suspension.
    pub suspension: [f64; 2],
    /// Stiffness (N/m) and damping (N s/m) of the stinger between armature and structure.
    pub stinger: [f64; 2],
    /// Mass at the structure's end of the stinger, kg: of the force cell and what it is mounted with, or of the table that carries the structure.
    pub end_mass: f64,
    /// Resistance of the coil, ohm.
    pub resistance: f64,
    /// Inductance of the coil, H.
    pub inductance: f64,
    /// Force per current, N/A, which is also the voltage per velocity, V s/m.
    pub force_factor: f64,
    /// What the amplifier controls.
    pub amplifier: Amplifier,
    /// Output of the amplifier per command, V/V or A/V.
    pub gain: f64,
    /// Cut-off frequency of the amplifier, rad/s; `None`: it follows at once.
    pub cut_off: Option<f64>,
}

/// What an amplifier controls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "lowercase")
)]
pub enum Amplifier {
    /// The voltage of the coil. Without a command the coil is shorted.
    #[default]
    Voltage,
    /// Its current. Without a command the coil is open.
    Current,
}

/// What is measured on a structure with a shaker: sums over the sections.
#[derive(Clone, Debug, PartialEq)]
pub struct ShakerRows {
    /// Displacement of the structure's end of the stinger, m.
    pub end: Row,
    /// Displacement of the armature, m.
    pub armature: Row,
    /// Force of the stinger on the structure, N.
    pub force: Row,
    /// Current of the coil, A, less what [`Self::current_per_command`] makes of the command.
    pub current: Row,
    /// Current per command, A/V.
    pub current_per_command: f64,
    /// Voltage of the coil, V, less what [`Self::voltage_per_command`] makes of the command.
    pub voltage: Row,
    /// Voltage per command, V/V. Where a controlled current has no cut-off, its inductance is left out.
    pub voltage_per_command: f64,
}

/// Matrices of a structure with its shaker.
struct Assembly {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    cavity: Vec<f64>,
    /// The displacements of the structure's end of the stinger, and of the armature.
    end: DVector<f64>,
    armature: DVector<f64>,
}

/// Matrices and rows of a structure without a shaker.
struct Alone {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    cavity: Vec<f64>,
    drive: Vec<f64>,
}

impl Alone {
    fn of(structure: &Equations) -> Result<Self, InvalidHost> {
        let diagonal = |values: Vec<f64>| DMatrix::from_diagonal(&DVector::from_vec(values));
        let square = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j]);
        Ok(match structure {
            Equations::Modes(modes) => Self {
                mass: DMatrix::identity(modes.len(), modes.len()),
                damping: diagonal(modes.iter().map(|mode| 2.0 * mode.zeta * mode.omega).collect()),
                stiffness: diagonal(modes.iter().map(|mode| mode.omega * mode.omega).collect()),
                cavity: modes.iter().map(|mode| mode.cavity).collect(),
                drive: modes.iter().map(|mode| mode.drive).collect(),
            },
            Equations::Matrices { states, .. } if !states.is_empty() => {
                return Err(InvalidHost("the structure has a shaker already".into()));
            }
            Equations::Matrices { mass, damping, stiffness, cavity, drive, .. } => Self {
                mass: square(mass),
                damping: square(damping),
                stiffness: square(stiffness),
                cavity: cavity.clone(),
                drive: drive.clone(),
            },
        })
    }
}

fn rows(matrix: DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

impl Equations {
    /// A structure with a mass, kg, at the point of its force: what the stinger of a shaker moves behind the force cell.
    ///
    /// # Errors
    /// A structure that has a shaker already.
    pub fn carrying(&self, end_mass: f64) -> Result<Self, InvalidHost> {
        let Alone { mass, damping, stiffness, cavity, drive } = Alone::of(self)?;
        let direction = DVector::from_row_slice(&drive);
        Ok(Self::Matrices {
            mass: rows(mass + end_mass * &direction * direction.transpose()),
            damping: rows(damping),
            stiffness: rows(stiffness),
            cavity,
            drive,
            states: Vec::new(),
        })
    }
}

impl Shaker {
    /// The structure that the shaker moves by its base, which is then a table of the mass [`Self::end_mass`], or by a force at its point. The command
    /// drives the result as a force ([`Excitation::Force`]).
    ///
    /// Coordinates of the host are those of the structure, the displacement of the base if there is one, and the stretch `x - y` of the stinger: with
    /// a stiff one, the difference of two displacements would lose its force.
    ///
    /// # Errors
    /// A structure that is refused; a value that is not finite or out of its range.
    pub fn attach(&self, structure: &Equations, by: Excitation) -> Result<Equations, InvalidHost> {
        self.check(by)?;
        structure.host(by)?;
        let Assembly { mass, damping, stiffness, cavity, armature, .. } = self.assembly(structure, by)?;
        let (drive, states) = self.electric(&armature);
        Ok(Equations::Matrices {
            mass: rows(mass),
            damping: rows(damping),
            stiffness: rows(stiffness),
            cavity,
            drive,
            states,
        })
    }

    /// What is measured on the host of the equations of [`Self::attach`].
    ///
    /// # Errors
    /// As for [`Self::attach`].
    pub fn rows(&self, host: &Host, structure: &Equations, by: Excitation) -> Result<ShakerRows, InvalidHost> {
        let Assembly { end, armature, .. } = self.assembly(structure, by)?;
        let (n, states) = (end.len(), self.electric(&armature).1);
        let stretch = |times: f64| unit(n, n - 1, times);
        let [force, damping] = self.stinger.map(stretch);
        let mut of_states = vec![0.0; states.len()];
        let (mut velocity, mut current_per_command) = (0.0, 0.0);
        let is_resistive = self.amplifier == Amplifier::Voltage && self.inductance == 0.0;
        let per_output = if is_resistive { 1.0 / self.resistance } else { 1.0 };
        if is_resistive {
            velocity = -self.force_factor / self.resistance;
        }
        match of_states.first_mut() {
            Some(first) => *first = per_output,
            None => current_per_command = self.gain * per_output,
        }
        let inductive = self.inductance * self.cut_off.unwrap_or(0.0);
        let (last, back, voltage_per_command) = match (self.amplifier, self.cut_off) {
            (Amplifier::Voltage, Some(_)) => (1.0, 0.0, 0.0),
            (Amplifier::Voltage, None) => (0.0, 0.0, self.gain),
            // R i + L i' + Bl x', with i' of the amplifier.
            (Amplifier::Current, Some(_)) => (self.resistance - inductive, self.force_factor, inductive * self.gain),
            (Amplifier::Current, None) => (0.0, self.force_factor, self.resistance * self.gain),
        };
        let voltage_of_states = unit(states.len(), states.len().wrapping_sub(1), last);
        let at_rest = stretch(0.0);
        Ok(ShakerRows {
            end: host.row(end.as_slice())?,
            armature: host.row(armature.as_slice())?,
            force: host.sum(&force, &damping, &vec![0.0; states.len()])?,
            current: host.sum(&at_rest, (velocity * &armature).as_slice(), &of_states)?,
            current_per_command,
            voltage: host.sum(&at_rest, (back * &armature).as_slice(), &voltage_of_states)?,
            voltage_per_command,
        })
    }

    fn check(&self, by: Excitation) -> Result<(), InvalidHost> {
        let positive = [
            ("mass of the armature", self.mass, "kg", true),
            ("stiffness of the suspension", self.suspension[0], "N/m", true),
            ("damping of the suspension", self.suspension[1], "N s/m", false),
            ("stiffness of the stinger", self.stinger[0], "N/m", true),
            ("damping of the stinger", self.stinger[1], "N s/m", false),
            (
                "mass at the structure's end of the stinger",
                self.end_mass,
                "kg",
                by == Excitation::Base,
            ),
            ("resistance of the coil", self.resistance, "ohm", true),
            ("inductance of the coil", self.inductance, "H", false),
            (
                "force factor Bl",
                self.force_factor,
                "N/A (the same number in V s/m)",
                true,
            ),
            ("gain of the amplifier", self.gain, "V/V or A/V", true),
            ("cut-off of the amplifier", self.cut_off.unwrap_or(1.0), "rad/s", true),
        ];
        for (name, value, unit, is_needed) in positive {
            let valid = value <= FASTEST && if is_needed { value > 0.0 } else { value >= 0.0 };
            if !valid {
                let allowed = if is_needed {
                    "a positive number"
                } else {
                    "0 or a positive number"
                };
                return Err(InvalidHost(format!(
                    "the shaker has the {name} {value:?} {unit}; it needs {allowed} up to 1e12"
                )));
            }
        }
        Ok(())
    }

    fn assembly(&self, structure: &Equations, by: Excitation) -> Result<Assembly, InvalidHost> {
        let Alone { mass, damping, stiffness, cavity, drive } = Alone::of(structure)?;
        let n = cavity.len();
        let has_base = by == Excitation::Base;
        let size = n + usize::from(has_base) + 1;
        // The base moves the structure through its springs and dampers.
        let extended = |matrix: &DMatrix<f64>| {
            let mut all = DMatrix::zeros(size, size);
            all.view_mut((0, 0), (n, n)).copy_from(matrix);
            if has_base {
                let direction = DVector::from_row_slice(&drive);
                let side = -(matrix * &direction);
                all.view_mut((0, n), (n, 1)).copy_from(&side);
                all.view_mut((n, 0), (1, n)).copy_from(&side.transpose());
                all[(n, n)] = -direction.dot(&side);
            }
            all
        };
        let (mut damping, mut stiffness) = (extended(&damping), extended(&stiffness));
        let mut all_mass = DMatrix::zeros(size, size);
        all_mass.view_mut((0, 0), (n, n)).copy_from(&mass);
        let mut end = DVector::zeros(size);
        if has_base {
            end[n] = 1.0;
        } else {
            end.rows_mut(0, n).copy_from_slice(&drive);
        }
        let stretch = DVector::from_vec(unit(size, size - 1, 1.0));
        let armature = &end + &stretch;
        all_mass += self.mass * &armature * armature.transpose() + self.end_mass * &end * end.transpose();
        stiffness += self.suspension[0] * &armature * armature.transpose();
        stiffness += self.stinger[0] * &stretch * stretch.transpose();
        let mut of_armature = self.suspension[1];
        if self.amplifier == Amplifier::Voltage && self.inductance == 0.0 {
            of_armature += self.force_factor * self.force_factor / self.resistance;
        }
        damping += of_armature * &armature * armature.transpose();
        damping += self.stinger[1] * &stretch * stretch.transpose();
        let mut row = vec![0.0; size];
        row[..n].copy_from_slice(&cavity);
        Ok(Assembly {
            mass: all_mass,
            damping,
            stiffness,
            cavity: row,
            end,
            armature,
        })
    }

    /// The force of the command on the degrees of freedom, and the first-order states: the current of a coil with inductance, then the output
    /// of an amplifier with a cut-off.
    fn electric(&self, armature: &DVector<f64>) -> (Vec<f64>, Vec<FirstOrderState>) {
        let Self { resistance, inductance, force_factor, gain, cut_off, .. } = *self;
        let at_armature = |value: f64| -> Vec<f64> { armature.iter().map(|at| at * value).collect() };
        let has_coil = self.amplifier == Amplifier::Voltage && inductance > 0.0;
        let per_output = match self.amplifier {
            Amplifier::Voltage if has_coil => 0.0,
            Amplifier::Voltage => force_factor / resistance,
            Amplifier::Current => force_factor,
        };
        let count = usize::from(has_coil) + usize::from(cut_off.is_some());
        let mut states = Vec::with_capacity(count);
        if has_coil {
            let mut rates = vec![0.0; count];
            rates[0] = resistance / inductance;
            let by_output = gain / inductance;
            // The output of the amplifier is the state behind it, or the command itself.
            if let Some(output) = rates.get_mut(1) {
                *output = -1.0 / inductance;
            }
            states.push(FirstOrderState {
                rates,
                velocity: at_armature(force_factor / inductance),
                force: at_armature(force_factor),
                drive: if cut_off.is_some() { 0.0 } else { by_output },
            });
        }
        if let Some(cut_off) = cut_off {
            let mut rates = vec![0.0; count];
            rates[count - 1] = cut_off;
            states.push(FirstOrderState {
                rates,
                velocity: at_armature(0.0),
                force: at_armature(per_output),
                drive: cut_off * gain,
            });
        }
        let at_once = if count > 0 { 0.0 } else { gain * per_output };
        (at_armature(at_once), states)
    }
}

/// A row with one entry.
fn unit(n: usize, place: usize, value: f64) -> Vec<f64> {
    (0..n).map(|other| if other == place { value } else { 0.0 }).collect()
}

// Clipping

/// Shortest time above the limit, over the length of a step: within it a crest exceeds the limit by less than rounding.
const SHORTEST_EXCESS: f64 = 1e-9;

impl Plant<Structure> {
    /// Advances by `duration` seconds under `drive`, which is [clipped](Self::clipped) at plus and minus `limit`. Returns whether it was clipped.
    ///
    /// # Errors
    /// An invalid drive or duration; the plant stays as it is.
    pub fn advance_within(&mut self, limit: f64, drive: Drive, duration: f64) -> Result<bool, InvalidValue> {
        let pieces = self.clipped(limit, drive, duration)?;
        for piece in &pieces {
            self.advance(piece.drive, piece.duration)?;
        }
        Ok(pieces.iter().any(|piece| piece.is_clipped))
    }

    /// The pieces of a step of `duration` seconds under `drive`, which is clipped at plus and minus `limit`: the step is split where the drive
    /// crosses it.
    ///
    /// # Errors
    /// An invalid drive.
    pub fn clipped(&self, limit: f64, drive: Drive, duration: f64) -> Result<Vec<Piece>, InvalidValue> {
        drive.validate()?;
        let motion = BaseMotion { drive, ..self.moving.base };
        let command = Command::new(&motion, duration);
        if command.bounds[0] <= limit {
            return Ok(vec![Piece { drive, duration, is_clipped: false }]);
        }
        let (mut begin, mut pieces) = (0.0, Vec::new());
        for end in command.crossings(limit, duration).into_iter().chain([duration]) {
            let middle = command.at(0.5 * (begin + end))[0];
            let is_clipped = middle.abs() > limit;
            let drive = if is_clipped {
                Drive {
                    signal: [limit.copysign(middle), 0.0, 0.0, 0.0],
                    amplitude: 0.0,
                    ..drive
                }
            } else {
                Drive { signal: shift(drive.signal, begin), ..drive }
            };
            pieces.push(Piece { drive, duration: end - begin, is_clipped });
            begin = end;
        }
        Ok(pieces)
    }
}

/// A piece of a step under a drive that is clipped at a limit.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The drive from its beginning on.
    pub drive: Drive,
    /// Its length, s.
    pub duration: f64,
    /// Whether the drive is at its limit.
    pub is_clipped: bool,
}

/// A drive over a step.
struct Command<'a> {
    motion: &'a BaseMotion,
    /// Bounds of its value and of its first two derivatives.
    bounds: [f64; 3],
}

impl<'a> Command<'a> {
    fn new(motion: &'a BaseMotion, duration: f64) -> Self {
        let Drive { signal, amplitude, omega } = motion.drive;
        let [u0, u1, u2, _] = shift(signal.map(f64::abs), duration.abs());
        let (size, rate) = (amplitude.abs(), omega.abs());
        Self {
            motion,
            bounds: [u0 + size, u1 + size * rate, 2.0 * u2 + size * rate * rate],
        }
    }

    /// Value and first derivatives after `t` seconds.
    fn at(&self, t: f64) -> [f64; 7] {
        let BaseMotion { drive, .. } = self.motion;
        let phasor = crate::segment::phasor(&self.motion.after(t)).unwrap_or_default();
        drive_derivatives(drive, phasor, drive.omega.abs(), t)
    }

    /// Where the magnitude crosses `limit`, in order.
    fn crossings(&self, limit: f64, duration: f64) -> Vec<f64> {
        let mut found = Vec::new();
        for sign in [-1.0, 1.0] {
            self.search(sign * limit, [0.0, duration], SHORTEST_EXCESS * duration, &mut found);
        }
        found.sort_by(f64::total_cmp);
        found
    }

    /// The crossings of `level` in an interval: none where the value is too far off, at most one where the slope has one sign, and else those in
    /// its halves.
    fn search(&self, level: f64, [begin, end]: [f64; 2], shortest: f64, found: &mut Vec<f64>) {
        let half = 0.5 * (end - begin);
        let middle = begin + half;
        let [value, slope, ..] = self.at(middle);
        if (value - level).abs() > self.bounds[1] * half || half <= shortest {
            return;
        }
        if slope.abs() <= self.bounds[2] * half {
            self.search(level, [begin, middle], shortest, found);
            self.search(level, [middle, end], shortest, found);
            return;
        }
        let is_above = |t: f64| self.at(t)[0] > level;
        let (mut low, mut high, first) = (begin, end, is_above(begin));
        if is_above(end) == first {
            return;
        }
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            *(if is_above(middle) == first { &mut low } else { &mut high }) = middle;
        }
        found.push(high);
    }
}
