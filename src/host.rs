//! The host of the cavity: a linear structure as a sum of second-order sections.
//!
//! A section has the state `(x, v)`. The drive `u` (base displacement, m, or force, N) and a force `f` of the particle on the host at the
//! cavity (N) move it:
//!
//! ```text
//! x' = v + d u + k0 f,    v' = -omega0² x - 2 delta v + (c - 2 delta d) u + k1 f
//! ```
//!
//! Hence `x'' + 2 delta x' + omega0² x = c u + d u'` without the particle, and an impulse `J` (N s) adds `[k0, k1] J` to `(x, v)`. The
//! displacement of a point is `sum a x + b v`, with a pair `[a, b]` per section: its row. A jump of `u` leaves `(x, v)` as they are.
//!
//! - A real mode with the mass-normalised shape `phi` is one section whose `x` is the modal coordinate: `k = [0, phi_cavity]`, row
//!   `[phi_point, 0]`, and `c = Gamma omega0²`, `d = 2 delta Gamma` for a base with the participation `Gamma`, or `c = psi`, `d = 0` for a
//!   force at a point with the shape `psi`.
//! - Without proportional damping, and during persistent contact, modes are complex pairs: then `b` and `d` are not 0. Two real poles make
//!   one overdamped section; of an odd number one is left over, whose section has a second pole that nothing excites.
//!
//! A coil or a filter adds first-order states ([`FirstOrderState`]).
//!
//! Source of the expansion of a symmetric quadratic eigenproblem in its modes: P. Lancaster, "Lambda-matrices and Vibrating Systems",
//! Pergamon 1966, chapter 4.

use core::fmt;

use nalgebra::linalg::Schur;
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen, Vector2};
use num_complex::Complex64;

use crate::arithmetic::{plus, product, times};
use crate::oscillator::{Oscillator, Transition};
use crate::parameters::FASTEST;

/// What drives a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Excitation {
    /// The displacement of its base, m.
    Base,
    /// A force, N, or the command of the amplifier of a [shaker](crate::Shaker), V.
    Force,
}

/// A real mode: its shapes are mass-normalised, 1/sqrt(kg).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Mode {
    /// Natural frequency without damping, rad/s.
    pub omega: f64,
    /// Damping ratio, from 0 to below 1.
    pub zeta: f64,
    /// Shape at the cavity, 1/sqrt(kg).
    pub cavity: f64,
    /// For a force: shape at the point where it acts, 1/sqrt(kg). For a base: participation factor, sqrt(kg).
    pub drive: f64,
}

/// One second-order section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Decay rate and natural frequency.
    pub oscillator: Oscillator,
    /// `[c, d]`: `x'' + 2 delta x' + omega0² x = c u + d u'`.
    pub drive: [f64; 2],
    /// `[k0, k1]`: what an impulse of 1 N s at the cavity adds to `(x, v)`.
    pub kick: [f64; 2],
    /// `[a, b]`: the displacement of the host at the cavity contains `a x + b v`.
    pub cavity: [f64; 2],
}

/// A pair `[a, b]` per section: the displacement of a point is the sum of `a x + b v`.
pub type Row = Vec<[f64; 2]>;

/// Why a host is refused, in one sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InvalidHost(pub String);

impl fmt::Display for InvalidHost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for InvalidHost {}

/// A first-order state `z` beside `n` degrees of freedom `q`, such as the current of a coil: `z' = b u - sum of rates z - velocity q'`, and the
/// structure gets the forces `force z`.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FirstOrderState {
    /// Per first-order state, 1/s.
    pub rates: Vec<f64>,
    /// Per velocity of a degree of freedom.
    pub velocity: Vec<f64>,
    /// On every degree of freedom.
    pub force: Vec<f64>,
    /// `b`, per unit of the drive.
    pub drive: f64,
}

/// What a host is made of.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "lowercase", deny_unknown_fields)
)]
pub enum Equations {
    /// [`Host::from_modes`].
    Modes(Vec<Mode>),
    /// The matrices of `n` degrees of freedom, row by row: `M q'' + C q' + K q = K i e + C i e'`, or `= d F`. Coordinates of the host's points
    /// are the degrees of freedom.
    Matrices {
        /// `M`, kg.
        mass: Vec<Vec<f64>>,
        /// `C`, N s/m.
        damping: Vec<Vec<f64>>,
        /// `K`, N/m.
        stiffness: Vec<Vec<f64>>,
        /// The row `p` of the cavity: its displacement is `p q`.
        cavity: Vec<f64>,
        /// For a base: the displacements `i` of the structure per displacement of the base. For a force: the row `d` of its point.
        drive: Vec<f64>,
        /// First-order states beside the degrees of freedom: of a coil and an amplifier. Such a structure is driven by a force.
        #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
        states: Vec<FirstOrderState>,
    },
}

impl Equations {
    /// The host.
    ///
    /// # Errors
    /// Modes: as for [`Host::from_modes`]. Matrices: unequal sizes, not symmetric, not positive definite (`M`, `K`) or with a negative eigenvalue
    /// (`C`); first-order states and a base as the excitation; a cavity that nothing moves.
    pub fn host(&self, excitation: Excitation) -> Result<Host, InvalidHost> {
        match self {
            Self::Modes(modes) => Host::from_modes(excitation, modes),
            Self::Matrices { mass, damping, stiffness, cavity, drive, states } => {
                check(states.is_empty() || excitation == Excitation::Force, || {
                    "a structure with first-order states is driven by a force, not by its base".into()
                })?;
                Host::from_matrices(excitation, [mass, damping, stiffness], [cavity, drive], states)
            }
        }
    }
}

/// A number and its rounding error.
type Rounded = (f64, f64);

/// A linear structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Host {
    excitation: Excitation,
    /// The sections while the particle is free.
    sections: Vec<Section>,
    /// The structure in the coordinates of its modes without damping.
    pub(crate) modal: Modal,
    /// Displacements of the degrees of freedom per modal coordinate; `None`: the host was made from modes.
    shapes: Option<DMatrix<f64>>,
    /// The reverse.
    to_modal: Option<DMatrix<f64>>,
    /// The row of the cavity.
    cavity: Row,
    /// The modal coordinates from the sections, where the sections are not these coordinates.
    pub(crate) expansion: Option<Expansion>,
}

/// `eta'' + Delta eta' + diag(omega²) eta = g u + h u' + phi f`, in mass-normalised modal coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Modal {
    /// `omega²` with its rounding error, 1/s².
    pub stiffness: Vec<(f64, f64)>,
    /// `Delta`, 1/s.
    pub damping: DMatrix<f64>,
    /// `phi`, 1/sqrt(kg).
    pub cavity: DVector<f64>,
    /// `g`.
    pub drive: DVector<f64>,
    /// `h`.
    pub drive_rate: DVector<f64>,
    /// Displacement of the modal coordinates with the base, sqrt(kg); 0 for a force.
    pub carried: DVector<f64>,
    /// The first-order states; there `h` is 0.
    pub beside: Beside,
}

/// First-order states: `z' = b u - E z - S eta'`, with the forces `G z` on the modal coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Beside {
    /// `E`.
    rates: DMatrix<f64>,
    /// `S`.
    velocity: DMatrix<f64>,
    /// `G`.
    force: DMatrix<f64>,
    /// `b`.
    drive: DVector<f64>,
}

impl Beside {
    /// The states beside degrees of freedom with these mass-normalised shapes.
    fn new(states: &[FirstOrderState], shapes: &DMatrix<f64>) -> Self {
        let (count, n) = (states.len(), shapes.nrows());
        Self {
            rates: DMatrix::from_fn(count, count, |i, j| states[i].rates[j]),
            velocity: DMatrix::from_fn(count, n, |i, j| states[i].velocity[j]) * shapes,
            force: shapes.tr_mul(&DMatrix::from_fn(n, count, |i, j| states[j].force[i])),
            drive: vector(states.iter().map(|state| state.drive)),
        }
    }

    fn none(n: usize) -> Self {
        Self::new(&[], &DMatrix::identity(n, n))
    }

    pub(crate) fn count(&self) -> usize {
        self.drive.len()
    }
}

impl Host {
    /// A host with these modes. Coordinates of its points are the modes: a point is given by its mass-normalised shapes.
    ///
    /// # Errors
    /// No mode; a frequency that is not positive; a damping ratio outside 0 to below 1; a shape that is not finite; a cavity that no mode
    /// moves.
    pub fn from_modes(excitation: Excitation, modes: &[Mode]) -> Result<Self, InvalidHost> {
        for (n, mode) in modes.iter().enumerate() {
            let n = n + 1;
            check((1e-12..=FASTEST).contains(&mode.omega), || {
                format!(
                    "mode {n} has the frequency {:?} rad/s; allowed is a number from 1e-12 to 1e12 rad/s",
                    mode.omega
                )
            })?;
            check((0.0..1.0).contains(&mode.zeta), || {
                format!(
                    "mode {n} has the damping ratio {:?}; a mode needs a number from 0 to below 1 (critical)",
                    mode.zeta
                )
            })?;
            check(mode.cavity.abs() <= 1e50 && mode.drive.abs() <= 1e50, || {
                format!(
                    "mode {n} has the shapes {:?} at the cavity and {:?} at the drive; allowed are finite numbers from -1e50 to 1e50",
                    mode.cavity, mode.drive
                )
            })?;
        }
        let stiffness: Vec<_> = modes.iter().map(|mode| product(mode.omega, mode.omega)).collect();
        let damping = modes.iter().map(|mode| product(2.0 * mode.zeta, mode.omega)).collect();
        let cavity = vector(modes.iter().map(|mode| mode.cavity));
        let drive = vector(modes.iter().map(|mode| mode.drive));
        Self::from_real_modes(excitation, (stiffness, damping), (cavity, drive), None)
    }

    /// `damping` is `2 delta` of every mode, 1/s.
    fn from_real_modes(
        excitation: Excitation,
        (stiffness, damping): (Vec<Rounded>, Vec<Rounded>),
        (cavity, drive): (DVector<f64>, DVector<f64>),
        shapes: Option<(DMatrix<f64>, DMatrix<f64>)>,
    ) -> Result<Self, InvalidHost> {
        let oscillators: Vec<_> = damping
            .iter()
            .zip(&stiffness)
            .map(|(damping, stiffness)| Oscillator::from_rates(*damping, *stiffness))
            .collect();
        let force = excitation == Excitation::Force;
        let section = |(n, oscillator): (usize, &Oscillator)| {
            let Oscillator { delta, omega0_squared, .. } = *oscillator;
            let drive = if force {
                [drive[n], 0.0]
            } else {
                [drive[n] * omega0_squared, drive[n] * (2.0 * delta)]
            };
            Section {
                oscillator: *oscillator,
                drive,
                kick: [0.0, cavity[n]],
                cavity: [cavity[n], 0.0],
            }
        };
        let sections: Vec<_> = oscillators.iter().enumerate().map(section).collect();
        let modal = Modal {
            stiffness,
            damping: DMatrix::from_diagonal(&vector(damping.iter().map(|rate| rate.0))),
            drive: vector(sections.iter().map(|section| section.drive[0])),
            drive_rate: vector(sections.iter().map(|section| section.drive[1])),
            carried: if force { 0.0 * &drive } else { drive },
            beside: Beside::none(cavity.len()),
            cavity,
        };
        Self::of(excitation, sections, modal, shapes, None)
    }

    /// The parts, with a cavity that something moves.
    fn of(
        excitation: Excitation,
        sections: Vec<Section>,
        modal: Modal,
        shapes: Option<(DMatrix<f64>, DMatrix<f64>)>,
        expansion: Option<Expansion>,
    ) -> Result<Self, InvalidHost> {
        let (shapes, to_modal) = shapes.unzip();
        check(!sections.is_empty(), || {
            "the structure has no mode; it needs at least one".into()
        })?;
        check(mobility(&sections) > 0.0, || {
            "the cavity is at a node of every mode; no impact can act on the structure there".into()
        })?;
        Ok(Self {
            excitation,
            cavity: sections.iter().map(|section| section.cavity).collect(),
            sections,
            modal,
            shapes,
            to_modal,
            expansion,
        })
    }

    /// What drives it.
    pub fn excitation(&self) -> Excitation {
        self.excitation
    }

    /// The sections while the particle is free.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// Velocity of the host at the cavity per impulse there, `S`, 1/kg: the sum of the squared shapes.
    pub fn mobility(&self) -> f64 {
        mobility(&self.sections)
    }
}

/// Velocity at the cavity per impulse there, 1/kg.
pub(crate) fn mobility(sections: &[Section]) -> f64 {
    sections
        .iter()
        .map(|section| section.velocity_per_impulse(section.cavity))
        .sum()
}

impl Section {
    /// `(x, v)` after `t` seconds without drive, as a linear map of `(x, v)` now.
    pub fn propagator(&self, t: f64) -> Matrix2<f64> {
        let Transition { xx, xv, vx, vv } = self.oscillator.flow(t).0;
        Matrix2::new(xx, xv, vx, vv)
    }

    /// The time derivative of `(x, v)` without drive.
    pub fn rate(&self, state: Vector2<f64>) -> Vector2<f64> {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        Vector2::new(state[1], -(omega0_squared * state[0] + 2.0 * delta * state[1]))
    }

    /// Displacement and velocity of a point with the pair `[a, b]`, without drive.
    pub fn at(&self, [a, b]: [f64; 2], state: Vector2<f64>) -> Vector2<f64> {
        state * a + self.rate(state) * b
    }

    /// Velocity of a point with the pair `[a, b]` per impulse at the cavity, 1/kg.
    pub fn velocity_per_impulse(&self, pair: [f64; 2]) -> f64 {
        self.at(pair, self.kick.into())[1]
    }

    /// `omega0² - omega² + 2 i delta omega`, 1/s².
    pub fn stiffness(&self, omega: f64) -> Complex64 {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        Complex64::new(omega0_squared - omega * omega, 2.0 * delta * omega)
    }

    /// Steady `(x, v)` times [`Self::stiffness`], per unit of a harmonic drive with the angular frequency `omega`, rad/s.
    pub fn driven(&self, omega: f64) -> [Complex64; 2] {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let [c, d] = self.drive;
        [
            Complex64::new(c, d * omega),
            Complex64::new(-d * omega0_squared, (c - 2.0 * delta * d) * omega),
        ]
    }

    /// The same per unit of a harmonic force at the cavity.
    pub fn kicked(&self, omega: f64) -> [Complex64; 2] {
        let Oscillator { delta, omega0_squared, .. } = self.oscillator;
        let [k0, k1] = self.kick;
        [
            Complex64::new(k1 + 2.0 * delta * k0, k0 * omega),
            Complex64::new(-k0 * omega0_squared, k1 * omega),
        ]
    }

    /// Steady `(x, v)` per unit of a harmonic drive.
    pub fn steady(&self, omega: f64) -> [Complex64; 2] {
        self.driven(omega).map(|state| state / self.stiffness(omega))
    }
}

fn check(valid: bool, message: impl FnOnce() -> String) -> Result<(), InvalidHost> {
    if valid { Ok(()) } else { Err(InvalidHost(message())) }
}

fn vector(values: impl ExactSizeIterator<Item = f64>) -> DVector<f64> {
    DVector::from_iterator(values.len(), values)
}

// From matrices

/// Tolerance of symmetry, relative to the largest entries of both rows.
const SYMMETRIC: f64 = 1e-9;
/// Rounding of a quadratic form, relative to the sum of its terms' magnitudes.
const FORM_ROUNDING: f64 = 64.0 * f64::EPSILON;

impl Host {
    /// The host of [`Equations::Matrices`].
    fn from_matrices(
        excitation: Excitation,
        [mass, damping, stiffness]: [&[Vec<f64>]; 3],
        [cavity, drive]: [&[f64]; 2],
        states: &[FirstOrderState],
    ) -> Result<Self, InvalidHost> {
        let n = mass.len();
        check(n > 0, || {
            "the structure has no degree of freedom; it needs at least one".into()
        })?;
        let mass = symmetric("M (mass matrix)", mass, n)?;
        let damping = symmetric("C (damping matrix)", damping, n)?;
        let stiffness = symmetric("K (stiffness matrix)", stiffness, n)?;
        for (name, row) in [("the cavity", cavity), ("the drive", drive)] {
            check(row.len() == n && row.iter().all(|entry| entry.abs() <= 1e50), || {
                format!(
                    "the row of {name} has {} entries; it needs {n} finite numbers, one per degree of freedom",
                    row.len()
                )
            })?;
        }
        positive("M (mass matrix)", "kg", &mass, f64::MIN_POSITIVE)?;
        positive("K (stiffness matrix)", "N/m", &stiffness, f64::MIN_POSITIVE)?;
        let size = damping.abs().row_sum().max();
        positive(
            "C (damping matrix)",
            "N s/m",
            &damping,
            -FORM_ROUNDING * n as f64 * size,
        )?;

        let shapes = shapes_without_damping(&mass, &stiffness)?;
        let to_modal = shapes.tr_mul(&mass);
        let column = |n: usize| shapes.column(n);
        let form = |a: &DMatrix<f64>, i: usize, j: usize| form(a, column(i).as_slice(), column(j).as_slice());
        let (row, drive) = (DVector::from_row_slice(cavity), DVector::from_row_slice(drive));
        let project = |x: &DVector<f64>| shapes.tr_mul(x);
        let natural = quotients(&stiffness, &mass, &shapes);
        let rates = quotients(&damping, &mass, &shapes);
        let size = |i: usize, j: usize| (column(i).abs().transpose() * damping.abs() * column(j).abs())[0];
        let modal_damping = DMatrix::from_fn(n, n, |i, j| if i == j { rates[i].0 } else { form(&damping, i, j).0 });
        let proportional = states.is_empty()
            && (0..n)
                .flat_map(|i| (0..i).map(move |j| (i, j)))
                .all(|(i, j)| modal_damping[(i, j)].abs() <= FORM_ROUNDING * size(i, j));
        let cavity = project(&row);
        let force = excitation == Excitation::Force;
        let participation = if force {
            project(&drive)
        } else {
            project(&(&mass * &drive))
        };
        if proportional {
            return Self::from_real_modes(
                excitation,
                (natural, rates),
                (cavity, participation),
                Some((shapes, to_modal)),
            );
        }
        let zero = DVector::zeros(n);
        let modal = Modal {
            drive: if force {
                participation.clone()
            } else {
                project(&(&stiffness * &drive))
            },
            drive_rate: if force {
                zero.clone()
            } else {
                project(&(&damping * &drive))
            },
            carried: if force { zero } else { participation },
            beside: Beside::new(states, &shapes),
            stiffness: natural,
            damping: modal_damping,
            cavity,
        };
        let (sections, expansion) = modal.sections(0.0)?;
        Self::of(excitation, sections, modal, Some((shapes, to_modal)), Some(expansion))
    }

    /// The row of a point: mass-normalised shapes (1/sqrt(kg)) for a host from modes, the row over the degrees of freedom for one from
    /// matrices.
    ///
    /// # Errors
    /// A wrong number of entries, or one that is not finite.
    pub fn row(&self, point: &[f64]) -> Result<Row, InvalidHost> {
        let shape = self.shape(point)?;
        Ok(match &self.expansion {
            None => shape.iter().map(|phi| [*phi, 0.0]).collect(),
            Some(expansion) => expansion.row(&shape),
        })
    }

    /// The modal coordinates of a point.
    fn shape(&self, point: &[f64]) -> Result<DVector<f64>, InvalidHost> {
        let n = self.modal.stiffness.len();
        check(
            point.len() == n && point.iter().all(|entry| entry.abs() <= 1e50),
            || {
                format!(
                    "a point has {} entries; it needs {n} finite numbers, one per mode or degree of freedom",
                    point.len()
                )
            },
        )?;
        let point = DVector::from_row_slice(point);
        let shapes = self.shapes.as_ref();
        Ok(shapes.map_or_else(|| point.clone(), |shapes| shapes.tr_mul(&point)))
    }

    /// The row of a sum of displacements, velocities and first-order states, for a drive that is not a base: a force of springs and dampers, or
    /// a current.
    pub(crate) fn sum(&self, displacements: &[f64], velocities: &[f64], states: &[f64]) -> Result<Row, InvalidHost> {
        let [displacements, velocities] = [self.shape(displacements)?, self.shape(velocities)?];
        let all = displacements.iter().chain(velocities.iter()).chain(states);
        let row = self.maps().0.tr_mul(&DVector::from_iterator(
            2 * displacements.len() + states.len(),
            all.copied(),
        ));
        Ok(row.as_slice().chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
    }

    /// Steady displacement of a point per unit of a harmonic drive with the angular frequency `omega`, rad/s.
    pub fn frequency_response(&self, row: &[[f64; 2]], omega: f64) -> Complex64 {
        response(row, self.sections.iter().map(|section| section.steady(omega)))
    }

    /// Steady value of a sum over the sections per unit of a harmonic force at the cavity, such as m/N.
    pub fn frequency_response_to_cavity(&self, row: &[[f64; 2]], omega: f64) -> Complex64 {
        let steady = |section: &Section| section.kicked(omega).map(|state| state / section.stiffness(omega));
        response(row, self.sections.iter().map(steady))
    }

    /// The row of the cavity.
    pub fn cavity_row(&self) -> &Row {
        &self.cavity
    }

    /// Velocity of a point per impulse at the cavity, 1/kg.
    pub fn velocity_per_impulse(&self, row: &[[f64; 2]]) -> f64 {
        row.iter()
            .zip(&self.sections)
            .map(|(pair, section)| section.velocity_per_impulse(*pair))
            .sum()
    }

    /// Velocity of a point per jump of the drive.
    pub fn velocity_per_jump(&self, row: &[[f64; 2]]) -> f64 {
        let of = |(pair, section): (&[f64; 2], &Section)| {
            let [c, d] = section.drive;
            pair[0] * d + pair[1] * (c - 2.0 * section.oscillator.delta * d)
        };
        row.iter().zip(&self.sections).map(of).sum()
    }

    /// `(x, v)` of the sections from displacements and velocities of the coordinates under the drive `u`; empty ones are 0.
    ///
    /// # Errors
    /// A wrong number of values, or one that is not finite.
    pub fn state(&self, displacements: &[f64], velocities: &[f64], u: f64) -> Result<Vec<[f64; 2]>, InvalidHost> {
        let n = self.modal.stiffness.len();
        let mut modal = DVector::zeros(2 * n + self.modal.beside.count());
        for (k, (name, values)) in [("displacements", displacements), ("velocities", velocities)]
            .into_iter()
            .enumerate()
        {
            check(
                values.is_empty() || (values.len() == n && values.iter().all(|value| value.abs() <= 1e100)),
                || {
                    let got = values.len();
                    format!(
                        "the start has {got} {name}; it needs {n} finite numbers, one per mode or degree of freedom"
                    )
                },
            )?;
            if !values.is_empty() {
                let values = DVector::from_row_slice(values);
                let of_modes = self
                    .to_modal
                    .as_ref()
                    .map_or_else(|| values.clone(), |to_modal| to_modal * &values);
                modal.rows_mut(k * n, n).copy_from(&of_modes);
            }
        }
        for i in 0..n {
            modal[n + i] -= self.modal.drive_rate[i] * u;
        }
        let state = self.maps().1 * modal;
        Ok(state
            .as_slice()
            .chunks_exact(2)
            .map(|pair| [pair[0], pair[1]])
            .collect())
    }

    /// Modal coordinates, momenta and first-order states from `(x, v)` of the sections, and back.
    pub(crate) fn maps(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        if let Some(expansion) = &self.expansion {
            return (expansion.to_modal.clone(), expansion.to_sections.clone());
        }
        let n = self.sections.len();
        let to_modal = DMatrix::from_fn(2 * n, 2 * n, |i, j| f64::from(j == 2 * (i % n) + i / n));
        (to_modal.clone(), to_modal.transpose())
    }

    /// Kinetic and elastic energy, J, in the state `(x, v)` of the sections under the drive `u`.
    pub fn energy(&self, state: &[[f64; 2]], u: f64) -> f64 {
        let n = self.modal.stiffness.len();
        let modal = self.maps().0 * DVector::from_row_slice(state.as_flattened());
        let of = |i: usize| {
            let velocity = modal[n + i] + self.modal.drive_rate[i] * u;
            let stretch = modal[i] - self.modal.carried[i] * u;
            0.5 * (velocity * velocity + self.modal.stiffness[i].0 * stretch * stretch)
        };
        (0..n).map(of).sum()
    }
}

fn response(row: &[[f64; 2]], states: impl Iterator<Item = [Complex64; 2]>) -> Complex64 {
    row.iter().zip(states).map(|([a, b], [x, v])| x * a + v * b).sum()
}

/// A symmetric matrix, checked.
fn symmetric(name: &str, rows: &[Vec<f64>], n: usize) -> Result<DMatrix<f64>, InvalidHost> {
    check(rows.len() == n && rows.iter().all(|row| row.len() == n), || {
        format!("{name} is not a square of {n} rows and columns, as many as M has rows")
    })?;
    let matrix = DMatrix::from_fn(n, n, |i, j| rows[i][j]);
    check(matrix.iter().all(|entry| entry.abs() <= 1e50), || {
        format!("{name} has an entry that is not a finite number from -1e50 to 1e50")
    })?;
    for i in 0..n {
        for j in 0..i {
            let (below, above) = (matrix[(i, j)], matrix[(j, i)]);
            let size = matrix.row(i).amax().max(matrix.row(j).amax());
            check((below - above).abs() <= SYMMETRIC * size, || {
                let (i, j) = (i + 1, j + 1);
                format!("{name} is not symmetric: entry ({i}, {j}) is {below:?} and entry ({j}, {i}) is {above:?}")
            })?;
        }
    }
    Ok(DMatrix::from_fn(n, n, |i, j| {
        0.5 * matrix[(i, j)] + 0.5 * matrix[(j, i)]
    }))
}

/// Refuses a matrix with an eigenvalue below `least`.
fn positive(name: &str, unit: &str, matrix: &DMatrix<f64>, least: f64) -> Result<(), InvalidHost> {
    let smallest = SymmetricEigen::new(matrix.clone()).eigenvalues.min();
    check(smallest >= least, || {
        let needed = if least > 0.0 { "positive" } else { "at least 0" };
        format!("{name} has the eigenvalue {smallest:.6e} {unit}; all of its eigenvalues must be {needed}")
    })
}

/// `x A y` with its rounding error.
fn form(a: &DMatrix<f64>, x: &[f64], y: &[f64]) -> (f64, f64) {
    let mut sum = (0.0, 0.0);
    for (i, x) in x.iter().enumerate() {
        for (j, y) in y.iter().enumerate() {
            sum = plus(sum, times(product(*x, a[(i, j)]), (*y, 0.0)));
        }
    }
    sum
}

/// `x A x/(x M x)` of mass-normalised columns `x`, for which `x M x` is near 1.
fn quotients(a: &DMatrix<f64>, mass: &DMatrix<f64>, x: &DMatrix<f64>) -> Vec<Rounded> {
    let of = |column: &[f64]| {
        let (a, m) = (form(a, column, column), form(mass, column, column));
        times(a, (1.0 - (m.0 - 1.0), -m.1))
    };
    x.column_iter().map(|column| of(column.as_slice())).collect()
}

/// Mass-normalised shapes without damping, as columns, and squares of the natural frequencies, from the lowest on: `K phi = omega² M phi`.
///
/// # Errors
/// Matrices that are not positive definite, or too badly scaled.
pub fn natural_modes(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Result<(DMatrix<f64>, Vec<f64>), InvalidHost> {
    let shapes = shapes_without_damping(mass, stiffness)?;
    let squares = quotients(stiffness, mass, &shapes)
        .iter()
        .map(|square| square.0)
        .collect();
    Ok((shapes, squares))
}

/// Mass-normalised modes without damping, as columns, from the lowest frequency on.
///
/// The eigenvalues of the symmetric solver are exact to the rounding of the largest only, so that the eigenvectors are refined until all
/// digits are right (Ogita and Aishima, "Iterative refinement for symmetric eigenvalue decomposition", Japan J. Indust. Appl. Math. 35 (2018)
/// 1007).
fn shapes_without_damping(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Result<DMatrix<f64>, InvalidHost> {
    let n = mass.nrows();
    let no_modes = || {
        InvalidHost(
            "the modes of M and K cannot be computed: the matrices are not positive definite, or too badly scaled"
                .into(),
        )
    };
    let lower = mass.clone().cholesky().ok_or_else(no_modes)?.l();
    let inverse = lower.try_inverse().ok_or_else(no_modes)?;
    let reduced = &inverse * stiffness * inverse.transpose();
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(0.5 * (&reduced + reduced.transpose()));
    let mut order: Vec<_> = (0..n).collect();
    order.sort_by(|i, j| eigenvalues[*i].total_cmp(&eigenvalues[*j]));
    let eigenvectors = inverse.tr_mul(&eigenvectors);
    let mut x = DMatrix::from_fn(n, n, |i, j| eigenvectors[(i, order[j])]);
    for _ in 0..4 {
        let entry = |a: &DMatrix<f64>, i: usize, j: usize| form(a, x.column(i).as_slice(), x.column(j).as_slice());
        let r = DMatrix::from_fn(n, n, |i, j| {
            let (value, error) = entry(mass, i, j);
            (if i == j { 1.0 - value } else { -value }) - error
        });
        let s = DMatrix::from_fn(n, n, |i, j| entry(stiffness, i, j).0);
        let values: Vec<_> = (0..n).map(|i| s[(i, i)] / (1.0 - r[(i, i)])).collect();
        let correction = DMatrix::from_fn(n, n, |i, j| {
            let apart = values[j] - values[i];
            // Modes nearer than rounding share a plane in which every pair serves.
            if i == j || apart.abs() <= FORM_ROUNDING * n as f64 * values[i].abs().max(values[j].abs()) {
                0.5 * r[(i, j)]
            } else {
                (s[(i, j)] + values[j] * r[(i, j)]) / apart
            }
        });
        x = &x + &x * correction;
    }
    check(x.iter().all(|entry| entry.is_finite()), || no_modes().0)?;
    Ok(x)
}

// Complex pairs and pairs of real poles

/// The modal coordinates, their momenta and the first-order states from the sections of a set, and back. A momentum is `p = eta' - h u`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expansion {
    /// `(x, v)` of every section from `eta`, `p` and `z`, and the part of `u`.
    pub to_sections: DMatrix<f64>,
    pub drive_to_sections: DVector<f64>,
    /// The reverse.
    pub to_modal: DMatrix<f64>,
    pub drive_to_modal: DVector<f64>,
}

impl Expansion {
    /// The row of a point with these shapes.
    fn row(&self, shape: &DVector<f64>) -> Row {
        let n = shape.len();
        let displacements = self.to_modal.rows(0, n).tr_mul(shape);
        displacements
            .as_slice()
            .chunks_exact(2)
            .map(|pair| [pair[0], pair[1]])
            .collect()
    }
}

/// An eigenvalue and eigenvectors of the pencil `Q(s)`, whose first rows are `s² (I + m phi phi^T) + s Delta + Omega²` and `-G`, and whose last
/// ones are `s S` and `s + E`.
struct Pole {
    lambda: Complex64,
    vector: DVector<Complex64>,
    /// The eigenvector of the transposed pencil: the same without first-order states, because the pencil is symmetric then.
    left: DVector<Complex64>,
    /// `left Q'(lambda) vector`: the inverse of `Q(s)` contains `vector left^T/(norm (s - lambda))`.
    norm: Complex64,
}

/// The second pole of the section of a lone real pole, over that pole. Nothing excites it; it is so near that a static response counts as the
/// steady motion, and so far that the rates are told apart.
const UNUSED: f64 = 1.1;

impl Modal {
    /// The sections of the structure that carries the mass `m` (kg) at the cavity.
    pub fn sections(&self, m: f64) -> Result<(Vec<Section>, Expansion), InvalidHost> {
        let (n, beside) = (self.stiffness.len(), self.beside.count());
        let poles = self.poles(m)?;
        let (pairs, mut reals): (Vec<_>, Vec<_>) = poles.into_iter().partition(|pole| pole.lambda.im != 0.0);
        reals.sort_by(|a, b| a.lambda.re.total_cmp(&b.lambda.re));
        let (states, count) = (2 * n + beside, 2 * (n + beside.div_ceil(2)));
        let mut sections = Vec::with_capacity(count / 2);
        let mut expansion = Expansion {
            to_sections: DMatrix::zeros(count, states),
            drive_to_sections: DVector::zeros(count),
            to_modal: DMatrix::zeros(states, count),
            drive_to_modal: DVector::zeros(states),
        };
        // The part of the drive in the momentum: (M^-1 - 1) h u.
        let slip = self.slip();
        let share = m / (1.0 + m * self.cavity.norm_squared());
        for i in 0..n {
            expansion.drive_to_modal[n + i] = -share * self.cavity[i] * slip;
        }
        let mut add = |poles: &[(&Pole, Complex64)], oscillator: Oscillator| {
            let k = 2 * sections.len();
            let [drive, kick] = self.enter_section(&mut expansion, k, poles, m);
            let cavity = self.leave_section(&mut expansion, k, poles);
            sections.push(Section {
                oscillator,
                drive: [drive[1] + 2.0 * oscillator.delta * drive[0], drive[0]],
                kick,
                cavity,
            });
        };
        for pole in &pairs {
            let conjugate = Pole {
                lambda: pole.lambda.conj(),
                vector: pole.vector.map(|entry| entry.conj()),
                left: pole.left.map(|entry| entry.conj()),
                norm: pole.norm.conj(),
            };
            let oscillator = Oscillator::from_rates((-2.0 * pole.lambda.re, 0.0), squared(pole.lambda));
            // With this weight an impulse at the cavity kicks `v` alone, and a real mode is its modal coordinate.
            let reference = self.reference(&pole.left);
            let size = libm::sqrt(2.0 / (pole.norm.norm() * pole.lambda.im)) * reference.norm();
            let kappa = Complex64::new(0.0, -0.5 * size) / reference;
            add(&[(pole, kappa), (&conjugate, kappa.conj())], oscillator);
        }
        for (fast, slow) in reals[..reals.len() / 2].iter().zip(reals.iter().rev()) {
            let (a, b) = (fast.lambda.re, slow.lambda.re);
            let oscillator = Oscillator::from_rates(plus((-a, 0.0), (-b, 0.0)), product(a, b));
            let gap = Complex64::from(b - a);
            let weight = |pole: &Pole| (self.reference(&pole.left) * gap).inv();
            add(&[(slow, weight(slow)), (fast, -weight(fast))], oscillator);
        }
        if let Some(lone) = reals.get(reals.len() / 2).filter(|_| reals.len() % 2 == 1) {
            let (a, b) = (lone.lambda.re, UNUSED * lone.lambda.re);
            let oscillator = Oscillator::from_rates(plus((-a, 0.0), (-b, 0.0)), product(a, b));
            add(&[(lone, (self.reference(&lone.left) * a).inv())], oscillator);
        }
        Ok((sections, expansion))
    }

    /// The velocity of the cavity that a drive of 1 puts into the momenta.
    fn slip(&self) -> f64 {
        self.cavity.dot(&self.drive_rate)
    }

    /// The rows `k` and `k + 1` of the way to the sections, for one or two poles with the weights `kappa` with which their coordinates make `x`. What a
    /// drive of 1 and an impulse of 1 at the cavity change of `(x, v)`.
    fn enter_section(
        &self,
        expansion: &mut Expansion,
        k: usize,
        poles: &[(&Pole, Complex64)],
        m: f64,
    ) -> [[f64; 2]; 2] {
        let (n, beside) = (self.stiffness.len(), self.beside.count());
        let sum = |of: &dyn Fn(&Pole) -> Complex64| {
            let [x, v] = [0, 1].map(|power| {
                (poles.iter())
                    .map(|(pole, kappa)| kappa * pole.lambda.powi(power) * of(pole))
                    .sum::<Complex64>()
                    .re
            });
            [x, v]
        };
        let along = |pole: &Pole, with: &DVector<f64>| dot(&pole.left.as_slice()[..n], with.as_slice());
        let of_states = |pole: &Pole, with: &[f64]| dot(&pole.left.as_slice()[n..], with);
        for i in 0..n {
            let eta = sum(&|pole| {
                let of_structure = pole.lambda * (pole.left[i] + m * self.cavity[i] * along(pole, &self.cavity))
                    + along(pole, &self.damping.column(i).into_owned());
                of_structure + of_states(pole, self.beside.velocity.column(i).as_slice())
            });
            let p = sum(&|pole| pole.left[i] + m * self.cavity[i] * along(pole, &self.cavity));
            for row in 0..2 {
                expansion.to_sections[(k + row, i)] = eta[row];
                expansion.to_sections[(k + row, n + i)] = p[row];
            }
        }
        for i in 0..beside {
            let z = sum(&|pole| pole.left[n + i]);
            (expansion.to_sections.fixed_view_mut::<2, 1>(k, 2 * n + i)).copy_from_slice(&z);
        }
        let slip = self.slip();
        let carried = sum(&|pole| m * along(pole, &self.cavity) * slip);
        (expansion.drive_to_sections.fixed_view_mut::<2, 1>(k, 0)).copy_from_slice(&carried);
        let drive = sum(&|pole| {
            let of_structure = along(pole, &self.drive) + pole.lambda * along(pole, &self.drive_rate);
            of_structure + of_states(pole, self.beside.drive.as_slice())
        });
        [drive, sum(&|pole| along(pole, &self.cavity))]
    }

    /// The columns `k` and `k + 1` of the way back, for these poles and weights. The displacement of the cavity for `x` and `v` of 1.
    fn leave_section(&self, expansion: &mut Expansion, k: usize, poles: &[(&Pole, Complex64)]) -> [f64; 2] {
        let (n, beside) = (self.stiffness.len(), self.beside.count());
        // The coordinates `kappa z` of the poles from `(x, v)`: `z1 + z2 = x`, `lambda1 z1 + lambda2 z2 = v`.
        let inverse: Vec<[Complex64; 2]> = match *poles {
            [(one, kappa_one), (two, kappa_two)] => {
                let apart = one.lambda - two.lambda;
                vec![
                    [-two.lambda / apart / kappa_one, apart.inv() / kappa_one],
                    [one.lambda / apart / kappa_two, -apart.inv() / kappa_two],
                ]
            }
            _ => poles.iter().map(|(_, kappa)| [kappa.inv(), Complex64::ZERO]).collect(),
        };
        for column in 0..2 {
            let part = |i: usize, power: i32| {
                let of = |((pole, _), inverse): (&(&Pole, Complex64), &[Complex64; 2])| {
                    let part = pole.vector[i] / pole.norm * inverse[column];
                    if power == 0 { part } else { pole.lambda * part }
                };
                poles.iter().zip(&inverse).map(of).sum::<Complex64>().re
            };
            for i in 0..n {
                expansion.to_modal[(i, k + column)] = part(i, 0);
                expansion.to_modal[(n + i, k + column)] = part(i, 1);
            }
            for i in 0..beside {
                expansion.to_modal[(2 * n + i, k + column)] = part(n + i, 0);
            }
        }
        [0, 1].map(|column| {
            (0..n)
                .map(|i| self.cavity[i] * expansion.to_modal[(i, k + column)])
                .sum::<f64>()
        })
    }

    /// What a mode is scaled by: its shape at the cavity, or its largest entry where the cavity is at a node.
    fn reference(&self, vector: &DVector<Complex64>) -> Complex64 {
        let (cavity, largest) = (
            dot(&vector.as_slice()[..self.cavity.len()], self.cavity.as_slice()),
            vector[vector.icamax()],
        );
        if cavity.norm() > 1e-6 * largest.norm() * self.cavity.amax() {
            cavity
        } else {
            largest
        }
    }

    /// Poles with an imaginary part of 0 or above, refined by Newton's method.
    fn poles(&self, m: f64) -> Result<Vec<Pole>, InvalidHost> {
        let (n, beside) = (self.stiffness.len(), self.beside.count());
        let omega: Vec<_> = self.stiffness.iter().map(|square| libm::sqrt(square.0)).collect();
        let share = m / (1.0 + m * self.cavity.norm_squared());
        let inverse_mass = DMatrix::identity(n, n) - share * &self.cavity * self.cavity.transpose();
        let damping = &inverse_mass * &self.damping;
        let force = &inverse_mass * &self.beside.force;
        // In the coordinates (omega eta, eta', z) all entries of a structure have the size of frequencies.
        let mut state = DMatrix::from_fn(2 * n + beside, 2 * n + beside, |i, j| match (i / n, j / n) {
            (0, 1) if j - n == i => omega[i],
            (0, _) => 0.0,
            (1, 0) => -inverse_mass[(i - n, j)] * omega[j],
            (1, 1) => -damping[(i - n, j - n)],
            (1, _) => force[(i - n, j - 2 * n)],
            (_, 0) => 0.0,
            (_, 1) => -self.beside.velocity[(i - 2 * n, j - n)],
            (_, _) => -self.beside.rates[(i - 2 * n, j - 2 * n)],
        });
        if beside > 0 {
            balance_parlett_reinsch(&mut state);
        }
        // The QR algorithm turns some matrices for ever; 30 steps for an eigenvalue are LAPACK's limit.
        let steps = 30 * state.nrows();
        let found = Schur::try_new(state, f64::EPSILON, steps).map(|schur| schur.complex_eigenvalues());
        let mut poles: Vec<_> = found
            .iter()
            .flatten()
            .filter(|lambda| lambda.im >= 0.0)
            .map(|lambda| self.pole(*lambda, m))
            .collect();
        // Sections by rising frequency, as modes are listed.
        poles.sort_by(|one, other| one.lambda.norm().total_cmp(&other.lambda.norm()));
        let count: usize = poles.iter().map(|pole| if pole.lambda.im == 0.0 { 1 } else { 2 }).sum();
        let apart = |one: &Pole, two: &Pole| (one.lambda - two.lambda).norm() > 1e-13 * one.lambda.norm();
        let distinct = (0..poles.len()).all(|i| (0..i).all(|j| apart(&poles[i], &poles[j])));
        check(
            count == 2 * n + beside
                && distinct
                && poles
                    .iter()
                    .all(|pole| pole.lambda.is_finite() && pole.norm.norm() > 0.0),
            || {
                "the modes with the particle on its wall cannot be told apart; change a frequency or a damping ratio by 1e-6".into()
            },
        )?;
        Ok(poles)
    }

    /// The pole near `lambda`.
    fn pole(&self, lambda: Complex64, m: f64) -> Pole {
        let (n, size) = (self.stiffness.len(), self.stiffness.len() + self.beside.count());
        let mass = |i: usize, j: usize| f64::from(i == j) + m * self.cavity[i] * self.cavity[j];
        let stiffness = |i: usize, j: usize| if i == j { self.stiffness[i].0 } else { 0.0 };
        let Beside { rates, velocity, force, .. } = &self.beside;
        let pencil = |lambda: Complex64| {
            DMatrix::from_fn(size, size, |i, j| match (i < n, j < n) {
                (true, true) => lambda * (lambda * mass(i, j) + self.damping[(i, j)]) + stiffness(i, j),
                (true, false) => Complex64::from(-force[(i, j - n)]),
                (false, true) => lambda * velocity[(i - n, j)],
                (false, false) => lambda * f64::from(i == j) + rates[(i - n, j - n)],
            })
        };
        let slope = |lambda: Complex64| {
            DMatrix::from_fn(size, size, |i, j| match (i < n, j < n) {
                (true, true) => lambda * 2.0 * mass(i, j) + self.damping[(i, j)],
                (true, false) => Complex64::ZERO,
                (false, true) => Complex64::from(velocity[(i - n, j)]),
                (false, false) => Complex64::from(f64::from(i == j)),
            })
        };
        let start = DVector::from_fn(size, |i, _| {
            Complex64::from(if i < n {
                self.stiffness[i].0 * (1.0 + 0.1 * i as f64)
            } else {
                1.0
            })
        });
        let (vector, lambda) = refined(lambda, &start, &pencil, &slope);
        let mut left = vector.clone();
        if size > n {
            left = refined(lambda, &start, &|s| pencil(s).transpose(), &|s| slope(s).transpose()).0;
        }
        let norm = (left.transpose() * slope(lambda) * &vector)[0];
        Pole { lambda, vector, left, norm }
    }
}

/// An eigenvector of a pencil, and its eigenvalue near `lambda`, by Newton's method.
fn refined(
    mut lambda: Complex64,
    start: &DVector<Complex64>,
    pencil: &dyn Fn(Complex64) -> DMatrix<Complex64>,
    slope: &dyn Fn(Complex64) -> DMatrix<Complex64>,
) -> (DVector<Complex64>, Complex64) {
    let n = start.len();
    let is_real = lambda.im == 0.0;
    // Inverse iteration for a start.
    let near = lambda * (1.0 + 1e-9);
    let mut vector = pencil(near).lu().solve(start).unwrap_or_else(|| start.clone());
    for _ in 0..6 {
        vector /= vector[vector.icamax()];
        let largest = vector.icamax();
        let (now, along) = (pencil(lambda), slope(lambda) * &vector);
        let mut bordered = DMatrix::zeros(n + 1, n + 1);
        bordered.view_mut((0, 0), (n, n)).copy_from(&now);
        bordered.view_mut((0, n), (n, 1)).copy_from(&along);
        bordered[(n, largest)] = Complex64::ONE;
        let mut right = DVector::zeros(n + 1);
        right.rows_mut(0, n).copy_from(&-(now * &vector));
        let Some(step) = bordered.lu().solve(&right) else { break };
        vector += step.rows(0, n);
        lambda += step[n];
        if is_real {
            lambda.im = 0.0;
        }
    }
    (vector, lambda)
}

/// `|lambda|²` with its rounding error.
fn squared(lambda: Complex64) -> (f64, f64) {
    plus(product(lambda.re, lambda.re), product(lambda.im, lambda.im))
}

fn dot(a: &[Complex64], b: &[f64]) -> Complex64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three modes, the third with a real pair of poles once the damping couples them.
    fn modal(coupling: f64, excitation: Excitation) -> Host {
        let mass = vec![vec![1.0, 0.1, 0.0], vec![0.1, 0.8, 0.05], vec![0.0, 0.05, 0.5]];
        let stiffness = vec![vec![3.0, -1.0, 0.0], vec![-1.0, 40.0, -20.0], vec![0.0, -20.0, 300.0]];
        let damping = vec![
            vec![0.05, -0.02, 0.0],
            vec![-0.02, 0.3 + coupling, 0.1],
            vec![0.0, 0.1, 0.2 + 40.0 * coupling],
        ];
        let (cavity, drive, states) = (vec![1.0, 0.2, 0.0], vec![1.0, 1.0, 0.3], vec![]);
        let equations = Equations::Matrices { mass, damping, stiffness, cavity, drive, states };
        equations.host(excitation).unwrap()
    }

    #[test]
    fn the_sum_of_the_sections_is_the_response_of_the_matrices() {
        for (coupling, excitation) in [
            (0.1, Excitation::Base),
            (0.1, Excitation::Force),
            (3.0, Excitation::Base),
            (3.0, Excitation::Force),
        ] {
            let host = modal(coupling, excitation);
            let overdamped = host
                .sections
                .iter()
                .filter(|s| s.oscillator.delta > s.oscillator.omega0)
                .count();
            assert_eq!(overdamped, usize::from(coupling > 1.0), "{coupling}");
            let point = [0.3, -0.7, 1.0];
            let row = host.row(&point).unwrap();
            let shape = host.shapes.as_ref().unwrap().tr_mul(&DVector::from_row_slice(&point));
            for omega in [0.1, 1.7, 7.0, 60.0] {
                for m in [0.0, 0.02, 3.0] {
                    let (sections, expansion) = host.modal.sections(m).unwrap();
                    let row = if m == 0.0 { row.clone() } else { expansion.row(&shape) };
                    let s = Complex64::new(0.0, omega);
                    let Modal { stiffness, damping, cavity, drive, drive_rate, .. } = &host.modal;
                    let q = DMatrix::from_fn(3, 3, |i, j| {
                        s * s * (f64::from(i == j) + m * cavity[i] * cavity[j])
                            + s * damping[(i, j)]
                            + if i == j { stiffness[i].0 } else { 0.0 }
                    });
                    let input = DVector::from_fn(3, |i, _| drive[i] + s * drive_rate[i]);
                    let expected = dot(q.lu().solve(&input).unwrap().as_slice(), shape.as_slice());
                    let got = response(&row, sections.iter().map(|section| section.steady(omega)));
                    assert!(
                        (got - expected).norm() < 1e-13 * input.norm(),
                        "{coupling} {m} {omega}: {got} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_wrong_with_a_structure_is_said_in_one_sentence() {
        let mode = Mode { omega: 1.0, zeta: 0.01, cavity: 1.0, drive: 1.0 };
        let refused = |modes: &[Mode]| Host::from_modes(Excitation::Force, modes).unwrap_err().to_string();
        assert!(refused(&[]).contains("no mode"));
        assert!(refused(&[mode, Mode { zeta: 1.0, ..mode }]).contains("mode 2 has the damping ratio 1.0"));
        assert!(refused(&[Mode { omega: 0.0, ..mode }]).contains("rad/s"));
        assert!(refused(&[Mode { cavity: 0.0, ..mode }]).contains("node"));
        assert!(refused(&[Mode { cavity: f64::NAN, ..mode }]).contains("finite"));
        let of = |mass: [[f64; 2]; 2], stiffness: [[f64; 2]; 2], damping: [[f64; 2]; 2]| {
            let rows = |matrix: [[f64; 2]; 2]| matrix.map(|row| row.to_vec()).to_vec();
            let equations = Equations::Matrices {
                mass: rows(mass),
                damping: rows(damping),
                stiffness: rows(stiffness),
                cavity: vec![1.0, 0.0],
                drive: vec![0.0, 1.0],
                states: vec![],
            };
            equations.host(Excitation::Force).unwrap_err().to_string()
        };
        let (unit, zero) = ([[1.0, 0.0], [0.0, 1.0]], [[0.0; 2]; 2]);
        assert!(of([[1.0, 0.1], [0.0, 1.0]], unit, zero).contains("entry (2, 1)"));
        assert!(of(unit, [[1.0, 2.0], [2.0, 1.0]], zero).contains("eigenvalue -1.000000e0 N/m"));
        assert!(of(unit, unit, [[0.1, 0.2], [0.2, 0.1]]).contains("C (damping matrix)"));
        assert!(of([[1.0, 1.0], [1.0, 1.0]], unit, zero).contains("M (mass matrix)"));
    }
}
