//! The parameters of a device: their names, types and values, and which values a host may write.

use super::codec::{ErrorCode, MAX_PAYLOAD, of_bytes, size, to_bytes};

/// Number of harmonics of a Fourier series.
pub const HARMONICS: usize = 16;
/// Number of its coefficients: mean, cosines, sines.
pub const COEFFICIENTS: usize = 2 * HARMONICS + 1;
/// Longest silence of the host, s, before the output is disarmed; 0: no limit.
pub const WATCHDOG: &str = "rig_watchdog";
/// Name of the device.
pub const EXPERIMENT: &str = "vines";
/// Name of the program.
pub const FIRMWARE: &str = concat!("vines ", env!("CARGO_PKG_VERSION"));

/// Which values a host may write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    /// None.
    Read,
    /// A command, carried out if the value is not 0; it reads 0.
    Pulse,
    Zero,
    ZeroOrOne,
    ZeroOrTwo,
    NotNegative,
    /// From 0 to below half the sample rate, Hz.
    Frequency,
    /// From -180 to 180 degrees.
    Angle,
    /// A Fourier series that cannot exceed `rig_out_max`.
    Series,
}

use Rule::{Angle, Frequency, NotNegative, Pulse, Read, Series, Zero, ZeroOrOne, ZeroOrTwo};

/// Names, type (as in Python's `struct`), number of values, rule, and value at the start. The order is that of version 3, then come those of
/// the rig and of the loop.
const PARAMETERS: &[(&str, u8, usize, Rule, f64)] = &[
    ("firmware experiment", b'c', 16, Read, 0.0),
    ("sample_freq", b'f', 1, Read, 0.0),
    (
        "ticks loop_time_last loop_time_max clock_jitter overruns",
        b'I',
        1,
        Read,
        0.0,
    ),
    ("tick_timeouts records_dropped", b'I', 1, Read, 0.0),
    ("freq", b'f', 1, Frequency, 0.0),
    ("target_coeffs forcing_coeffs", b'f', COEFFICIENTS, Series, 0.0),
    ("table", b'f', 4096, Read, 0.0),
    ("table_len", b'H', 1, Read, 0.0),
    ("table_freq", b'f', 1, Read, 0.0),
    ("table_gain", b'f', 1, Read, 1.0),
    ("table_interp", b'I', 1, Read, 1.0),
    ("table_mode", b'I', 1, Zero, 0.0),
    ("table_mult", b'I', 1, Read, 1.0),
    ("table_phase", b'f', 1, Read, 0.0),
    ("table_trigger", b'I', 1, Pulse, 0.0),
    ("wake_phase_min", b'I', 1, Read, 4_294_967_295.0),
    (
        "wake_phase_max t_measure_max t_actuate_max t_rest_max",
        b'I',
        1,
        Read,
        0.0,
    ),
    ("diag_reset", b'I', 1, Pulse, 0.0),
    ("cmd_backlog_max", b'I', 1, Read, 0.0),
    ("arm", b'I', 1, ZeroOrOne, 0.0),
    ("safety", b'I', 1, Read, 0.0),
    ("mcu_reboot", b'I', 1, Pulse, 0.0),
    ("rig_gain rig_out_max", b'f', 1, Read, 0.0),
    (WATCHDOG, b'f', 1, NotNegative, 0.0),
    ("impacts", b'I', 1, Read, 0.0),
    ("ctrl_reset", b'I', 1, Pulse, 0.0),
    ("control_mode", b'I', 1, ZeroOrTwo, 0.0),
    ("pll_centre_freq pll_freq_min pll_freq_max", b'f', 1, Frequency, 0.0),
    ("pll_target_phase", b'f', 1, Angle, -90.0),
    ("pll_demod_tau", b'f', 1, NotNegative, 0.1),
    ("pll_response_min", b'f', 1, NotNegative, 0.0),
    ("pll_lock_phase_tol", b'f', 1, NotNegative, 5.0),
    ("pll_unlock_phase_tol", b'f', 1, NotNegative, 10.0),
    ("pll_lock_dwell", b'f', 1, NotNegative, 0.1),
    ("pll_acquire_timeout", b'f', 1, NotNegative, 5.0),
];

#[derive(Debug)]
struct Parameter {
    name: &'static str,
    code: u8,
    rule: Rule,
    values: Vec<f64>,
}

/// All parameters, in the order of the table.
#[derive(Debug)]
pub struct Registry(Vec<Parameter>);

impl Registry {
    /// The values at the start, for a rate in Hz, the base displacement per volt in mm, and the largest output in V.
    pub fn new(sample_rate: f64, gain: f64, largest: f64) -> Self {
        let rows = PARAMETERS.iter().flat_map(|&(names, code, count, rule, value)| {
            let parameter = move |name| Parameter { name, code, rule, values: vec![value; count] };
            names.split(' ').map(parameter)
        });
        let mut registry = Self(rows.collect());
        for (name, text) in [("firmware", FIRMWARE), ("experiment", EXPERIMENT)] {
            let bytes: Vec<f64> = text.bytes().chain([0; 16]).take(16).map(f64::from).collect();
            registry.put(name, &bytes);
        }
        for (name, value) in [
            ("sample_freq", sample_rate),
            ("rig_gain", gain),
            ("rig_out_max", largest),
        ] {
            registry.put(name, &[value]);
        }
        registry
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// A page of definitions: those from `start` on that fit into a payload.
    pub fn page(&self, start: u16) -> Result<Vec<u8>, ErrorCode> {
        let rest = self.0.get(usize::from(start)..).ok_or(ErrorCode::BadIndex)?;
        let (mut next, mut page) = (start, Vec::new());
        for Parameter { name, code, rule, values } in rest {
            let writable = u8::from(*rule != Read);
            let definition = [
                name.as_bytes(),
                &[0, *code],
                &(values.len() as u16).to_le_bytes(),
                &[writable],
            ]
            .concat();
            if 4 + page.len() + definition.len() > MAX_PAYLOAD {
                break;
            }
            page.extend(definition);
            next += 1;
        }
        Ok([&start.to_le_bytes()[..], &next.to_le_bytes(), &page].concat())
    }

    /// The values of the parameters with these indices, as bytes.
    pub fn read(&self, indices: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        if indices.is_empty() || !indices.len().is_multiple_of(2) {
            return Err(ErrorCode::BadLength);
        }
        let mut bytes = Vec::new();
        for index in of_bytes(b'H', indices) {
            let parameter = self.0.get(index as usize).ok_or(ErrorCode::BadIndex)?;
            bytes.extend(to_bytes(parameter.code, &parameter.values));
            if bytes.len() > MAX_PAYLOAD {
                return Err(ErrorCode::BadLength);
            }
        }
        Ok(bytes)
    }

    /// The name and the values of a write that the table allows. Nothing changes yet.
    pub fn writing(&self, index: u16, bytes: &[u8]) -> Result<(&'static str, Vec<f64>), ErrorCode> {
        let parameter = self.0.get(usize::from(index)).ok_or(ErrorCode::BadIndex)?;
        let (code, rule) = (parameter.code, parameter.rule);
        if rule == Read {
            return Err(ErrorCode::ReadOnly);
        }
        if bytes.len() != parameter.values.len() * size(code) {
            return Err(ErrorCode::BadLength);
        }
        let values = of_bytes(code, bytes);
        let [value, rest @ ..] = &values[..] else {
            return Err(ErrorCode::BadLength);
        };
        let allowed = match rule {
            Read => false,
            Pulse => true,
            Zero => *value == 0.0,
            ZeroOrOne => *value <= 1.0,
            ZeroOrTwo => *value == 0.0 || *value == 2.0,
            NotNegative => *value >= 0.0 && value.is_finite(),
            Frequency => (0.0..0.5 * self.real("sample_freq")).contains(value),
            Angle => value.abs() <= 180.0,
            Series => {
                let (cosines, sines) = rest.split_at(HARMONICS);
                let harmonics = cosines.iter().zip(sines).map(|(a, b)| a.hypot(*b));
                value.abs() + harmonics.sum::<f64>() <= self.real("rig_out_max")
            }
        };
        allowed.then_some((parameter.name, values)).ok_or(ErrorCode::BadValue)
    }

    fn index(&self, name: &str) -> usize {
        let found = self.0.iter().position(|parameter| parameter.name == name);
        found.expect("a name of the table")
    }

    /// Sets the values of a parameter.
    pub fn put(&mut self, name: &str, values: &[f64]) {
        let index = self.index(name);
        self.0[index].values.copy_from_slice(values);
    }

    /// The values of a parameter.
    pub fn values(&self, name: &str) -> &[f64] {
        &self.0[self.index(name)].values
    }

    /// The value of a parameter.
    pub fn real(&self, name: &str) -> f64 {
        self.values(name)[0]
    }
}
