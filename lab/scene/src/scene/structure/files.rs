//! Files of a structure: a matrix, or poles and residues, as CSV with a line of names.

use std::path::Path;

use nalgebra::{DMatrix, SymmetricEigen};
use num_complex::Complex64;

use super::{FILE_ROUNDING, place};
use crate::scene::table::{Channel, Contents, plain_table};

/// The columns of the plain table under `key`: numbers under the names of points.
fn table(folder: &Path, key: &str, file: &Path) -> Result<Vec<Channel>, String> {
    let title = format!("{key} ({})", file.display());
    let bytes = std::fs::read(folder.join(file))
        .map_err(|error| format!("{title} cannot be read: {error}; paths are relative to the scene file"))?;
    let no_table = |reason: String| {
        format!(
            "{}; it must be a plain table (CSV), and `python -m vines structure FILE --cavity POINT` makes a scene of a universal file (UFF 55)",
            reason.replace("\n ", "")
        )
    };
    let Contents { layout, is_cut_off, channels, first_line, .. } = plain_table(&title, &bytes).map_err(no_table)?;
    if is_cut_off {
        return Err(format!("{title}: {layout}, and all rows are needed; repair the row"));
    }
    let mut names: Vec<&str> = Vec::new();
    for Channel { name, unit, values, texts, .. } in &channels {
        if name.is_empty() || name.parse::<f64>().is_ok() {
            return Err(no_table(format!(
                "{title} has no line of names at its top: give each column the name of its point"
            )));
        }
        if names.contains(&name.as_str()) {
            return Err(format!("{title} has two columns with the name {name}"));
        }
        if !unit.is_empty() && (name.as_str(), unit.as_str()) != ("frequency", "Hz") {
            return Err(format!(
                "{title}, column {name}: it states the unit {unit}, and numbers must be in SI units (frequencies in Hz), without a unit"
            ));
        }
        if let Some(n) = values.iter().position(|value| !value.is_finite()) {
            let cell = texts.get(n).cloned().unwrap_or_else(|| values[n].to_string());
            let line = first_line + n;
            return Err(format!("{title} has `{cell}` in line {line}: expected a finite number"));
        }
        names.push(name);
    }
    Ok(channels)
}

/// A square matrix with the names of its degrees of freedom.
pub(super) struct Matrix {
    /// Its key and its file, for messages.
    pub title: String,
    pub names: Vec<String>,
    pub values: DMatrix<f64>,
}

impl Matrix {
    pub(super) fn read(folder: &Path, key: &str, file: &Path) -> Result<Self, String> {
        let columns = table(folder, key, file)?;
        let (n, rows) = (columns.len(), columns[0].values.len());
        let title = format!("{key} ({})", file.display());
        if rows != n {
            return Err(format!("{title} has {n} columns and {rows} rows: it must be square"));
        }
        let values = DMatrix::from_fn(n, n, |row, column| columns[column].values[row]);
        let names = columns.into_iter().map(|column| column.name).collect();
        Ok(Self { title, names, values })
    }

    pub(super) fn symmetric(&self) -> Result<(), String> {
        let largest = self.values.amax();
        let (mut worst, mut place) = (0.0, (0, 0));
        for row in 0..self.values.nrows() {
            for column in 0..row {
                let difference = (self.values[(row, column)] - self.values[(column, row)]).abs();
                if difference > worst {
                    (worst, place) = (difference, (row, column));
                }
            }
        }
        if worst <= FILE_ROUNDING * largest {
            return Ok(());
        }
        let (row, column) = place;
        let [first, second] = [row, column].map(|n| &self.names[n]);
        let [below, above] = [self.values[(row, column)], self.values[(column, row)]];
        Err(format!(
            "{} is not symmetric: its element ({first}, {second}) is {below}, and ({second}, {first}) is {above}; they differ by {:.1e} of its largest \
             element, and {FILE_ROUNDING:e} is allowed, which is rounding: write it with ten digits, or with the mean of both in both places",
            self.title,
            worst / largest
        ))
    }

    /// Refuses a matrix that is not positive definite, or, if it `may_be_singular`, not positive semidefinite, by its smallest eigenvalues. `zero`: what
    /// eigenvalues of zero mean, and what to do.
    fn checked(&self, unit: &str, may_be_singular: bool, zero: &str) -> Result<(), String> {
        let mut values = SymmetricEigen::new(self.values.clone()).eigenvalues.as_slice().to_vec();
        values.sort_by(f64::total_cmp);
        let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let (title, count, smallest) = (&self.title, values.len(), values[0]);
        let rounding = f64::EPSILON * largest;
        let what = if may_be_singular { "semidefinite" } else { "definite" };
        let start =
            format!("{title} is not positive {what}: eigenvalue 1 of {count}, the smallest, is {smallest:.4e} {unit}");
        if smallest < -FILE_ROUNDING * largest {
            return Err(format!("{start}; check the signs of its elements"));
        }
        if may_be_singular || smallest > rounding {
            return Ok(());
        }
        // Rounding of the file as far as it shows, by the negative ones.
        let rounding = (count as f64 * rounding).max(-smallest);
        let zeros = values.iter().filter(|value| **value <= rounding).count();
        Err(format!("{start}; {zeros} of them are 0 within rounding. {zero}"))
    }

    /// Refuses a stiffness that is not positive definite.
    pub(super) fn stiff(&self) -> Result<(), String> {
        self.checked(
            "N/m",
            false,
            "They are motions without a force, such as the rigid-body modes of a free structure, and every mode must oscillate: add the stiffness of \
             its suspension, or describe the structure by its elastic modes (`modes` or `residues`)",
        )
    }

    /// Refuses a mass that is not positive definite.
    pub(super) fn heavy(&self) -> Result<(), String> {
        let massless = self
            .names
            .iter()
            .enumerate()
            .filter(|(n, _)| self.values[(*n, *n)] == 0.0);
        let massless: Vec<&str> = massless.map(|(_, name)| name.as_str()).collect();
        let named = match massless.is_empty() {
            true => String::new(),
            false => format!(": here {}", massless.join(", ")),
        };
        self.checked(
            "kg",
            false,
            &format!(
                "They are degrees of freedom, or combinations, without mass{named}. Take them out of M, C and K (static condensation), or give them \
                 their mass"
            ),
        )
    }

    /// Refuses a damping that is not positive semidefinite.
    pub(super) fn damped(&self) -> Result<(), String> {
        self.checked("N s/m", true, "")
    }
}

/// Largest sum of the parts of residues out of phase, relative to the sum of their sizes, that counts as zero: files state four digits. Noise does
/// not cancel.
const CANCELLED: f64 = 0.01;

/// Poles with positive imaginary part, and mass-normalised shapes at the points, 1/sqrt(kg); complex where the damping is not modal.
pub(super) struct Residues {
    pub points: Vec<String>,
    pub poles: Vec<(Complex64, Vec<Complex64>)>,
}

impl Residues {
    /// From the columns `frequency`, Hz, `damping`, the ratio, and `re POINT` and `im POINT`, m/(N s), for every point: the residues of the
    /// receptance for a force at the point `reference`.
    pub(super) fn read(folder: &Path, file: &Path, reference: Option<&str>) -> Result<Self, String> {
        let columns = table(folder, "residues", file)?;
        let title = format!("residues ({})", file.display());
        let column = |name: &str| {
            let found = columns.iter().find(|column| column.name == name);
            found.map(|column| &column.values).ok_or_else(|| {
                format!("{title} has no column `{name}`; needed are frequency (Hz), damping, and `re POINT` and `im POINT` (m/(N s)) for every point")
            })
        };
        let [frequency, damping] = [column("frequency")?, column("damping")?];
        let points: Vec<String> = columns
            .iter()
            .filter_map(|column| Some(column.name.strip_prefix("re ")?.trim().to_string()))
            .collect();
        let places = points
            .iter()
            .map(|point| Ok([column(&format!("re {point}"))?, column(&format!("im {point}"))?]));
        let places = places.collect::<Result<Vec<_>, String>>()?;
        let reference = reference.ok_or_else(|| {
            format!(
                "`reference` is missing: name the point at which the force of the modal test acted, one of {}",
                points.join(", ")
            )
        })?;
        let driven = place(&points, "reference", reference)?;
        let mut poles = Vec::new();
        for (n, (&hertz, &zeta)) in frequency.iter().zip(damping).enumerate() {
            let number = n + 1;
            if hertz <= 0.0 || !(0.0..1.0).contains(&zeta) {
                return Err(format!(
                    "mode {number} of {title} has {hertz} Hz and the damping ratio {zeta}: the frequency must be positive, the ratio at least 0 and below 1, \
                     because a mode must oscillate; leave out rigid-body modes (0 Hz)"
                ));
            }
            let omega = std::f64::consts::TAU * hertz;
            let pole = Complex64::new(-zeta * omega, omega * (1.0 - zeta * zeta).sqrt());
            // By reciprocity R_ij = phi_i phi_j/(2 i omega_d), with real shapes where the damping is modal.
            let scaled = |[re, im]: [&Vec<f64>; 2]| Complex64::new(re[n], im[n]) * Complex64::new(0.0, 2.0 * pole.im);
            let own = scaled(places[driven]).sqrt();
            if own.norm() == 0.0 {
                return Err(format!(
                    "mode {number} of {title} has the residue 0 at the reference {reference}: a force there does not reach it, and its shape does not \
                     follow; choose another reference"
                ));
            }
            if own.re.abs() < own.im.abs() {
                return Err(format!(
                    "mode {number} of {title} has a residue at the reference {reference} with a negative modal mass: its imaginary part must be \
                     negative, as of a receptance (displacement over force)"
                ));
            }
            poles.push((pole, places.iter().map(|&place| scaled(place) / own).collect()));
        }
        if poles.is_empty() {
            return Err(format!("{title} has no row: give one for every mode"));
        }
        poles.sort_by(|a, b| a.0.norm().total_cmp(&b.0.norm()));
        Ok(Self { points, poles })
    }

    /// M, C and K of a structure with as many points as modes whose shapes are complex; `None` for others, and where the parts out of phase are
    /// errors of the measurement.
    ///
    /// With the residues A of the poles s, the receptance is the sum of `A/(j omega - s)` and its conjugate. Its expansion for high frequencies
    /// gives the inverse of M and then C, its value at 0 the inverse of K (P. Lancaster, "Lambda-matrices and Vibrating Systems", chapter 7).
    pub(super) fn matrices(&self) -> Option<[DMatrix<f64>; 3]> {
        let n = self.points.len();
        let residues = self.poles.iter().map(|(pole, shape)| {
            let residue = |i: usize, j: usize| shape[i] * shape[j] / Complex64::new(0.0, 2.0 * pole.im);
            (pole, DMatrix::from_fn(n, n, residue))
        });
        let residues: Vec<_> = residues.collect();
        let sum = |weight: fn(Complex64) -> Complex64| {
            let parts = residues
                .iter()
                .map(|(pole, residue)| residue.map(|part| 2.0 * (weight(**pole) * part).re));
            parts.fold(DMatrix::zeros(n, n), |sum, part| sum + part)
        };
        let sizes = residues
            .iter()
            .map(|(_, residue)| residue.map(|part| 2.0 * part.re).norm());
        // An impulse on masses moves nothing at once.
        let is_consistent = sum(|_| Complex64::ONE).norm() <= CANCELLED * sizes.sum::<f64>();
        let is_real = |shape: &[Complex64]| shape.iter().all(|part| part.im.abs() <= FILE_ROUNDING * part.norm());
        if self.poles.len() != n || !is_consistent || self.poles.iter().all(|(_, shape)| is_real(shape)) {
            return None;
        }
        let mass = sum(|pole| pole).try_inverse()?;
        let stiffness = sum(|pole| -pole.inv()).try_inverse()?;
        let damping = -&mass * sum(|pole| pole * pole) * &mass;
        Some([mass, damping, stiffness].map(|matrix| 0.5 * (&matrix + matrix.transpose())))
    }
}
