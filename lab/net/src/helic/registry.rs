//! The parameters of a device: names, types, access, and values as the bytes of the protocol.

use super::codec::{ErrorCode, MAX_PAYLOAD, reals};

/// Number of harmonics of a Fourier series.
pub const HARMONICS: usize = 16;
/// Number of its coefficients: mean, cosines, sines.
pub const COEFFICIENTS: usize = 2 * HARMONICS + 1;
/// Largest number of values of the waveform table.
pub const TABLE: usize = 4096;
/// Longest text.
const TEXT: usize = 16;

/// Longest silence of the host, s, before the output is disarmed; 0: no limit.
pub const WATCHDOG: &str = "rig_watchdog";
/// The value of `mcu_reboot` that restarts a device.
pub const REBOOT: u32 = 0x5245_4254;

/// How a parameter is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Not at all.
    Read,
    /// By SetPar.
    Write,
    /// By SetPar, as a command that is carried out once; it reads 0.
    Pulse,
    /// By SetBlock and Commit.
    Block,
}

#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name, at most 23 bytes.
    pub name: &'static str,
    /// Type, as in Python's `struct`: `H`, `I`, `f` or `c`.
    pub code: u8,
    count: usize,
    /// How it is written.
    pub access: Access,
    value: Vec<u8>,
}

use Access::{Block, Pulse, Read, Write};

/// Name, type, number of values, access, and value at the start, of all parameters but the two texts.
const PARAMETERS: [(&str, u8, usize, Access, f32); 55] = [
    ("sample_freq", b'f', 1, Read, 0.0),
    ("ticks", b'I', 1, Read, 0.0),
    ("loop_time_last", b'I', 1, Read, 0.0),
    ("loop_time_max", b'I', 1, Read, 0.0),
    ("clock_jitter", b'I', 1, Read, 0.0),
    ("overruns", b'I', 1, Read, 0.0),
    ("tick_timeouts", b'I', 1, Read, 0.0),
    ("records_dropped", b'I', 1, Read, 0.0),
    ("freq", b'f', 1, Write, 0.0),
    ("target_coeffs", b'f', COEFFICIENTS, Write, 0.0),
    ("forcing_coeffs", b'f', COEFFICIENTS, Write, 0.0),
    ("table", b'f', TABLE, Block, 0.0),
    ("table_len", b'H', 1, Read, 0.0),
    ("table_freq", b'f', 1, Write, 0.0),
    ("table_gain", b'f', 1, Write, 1.0),
    ("table_interp", b'I', 1, Write, 1.0),
    ("table_mode", b'I', 1, Write, 0.0),
    ("table_mult", b'I', 1, Write, 1.0),
    ("table_phase", b'f', 1, Write, 0.0),
    ("table_trigger", b'I', 1, Pulse, 0.0),
    ("wake_phase_min", b'I', 1, Read, 4_294_967_295.0),
    ("wake_phase_max", b'I', 1, Read, 0.0),
    ("t_measure_max", b'I', 1, Read, 0.0),
    ("t_actuate_max", b'I', 1, Read, 0.0),
    ("t_rest_max", b'I', 1, Read, 0.0),
    ("diag_reset", b'I', 1, Pulse, 0.0),
    ("cmd_backlog_max", b'I', 1, Read, 0.0),
    ("arm", b'I', 1, Write, 0.0),
    ("safety", b'I', 1, Read, 0.0),
    ("mcu_reboot", b'I', 1, Pulse, 0.0),
    // Those of the rig.
    ("rig_gain", b'f', 1, Read, 0.0),
    ("rig_out_max", b'f', 1, Read, 0.0),
    (WATCHDOG, b'f', 1, Write, 0.0),
    // Those of the control.
    ("ctrl_reset", b'I', 1, Pulse, 0.0),
    ("control_mode", b'I', 1, Write, 0.0),
    ("pll_reacquire", b'I', 1, Pulse, 0.0),
    ("pll_centre_freq", b'f', 1, Write, 0.0),
    ("pll_freq_min", b'f', 1, Write, 0.0),
    ("pll_freq_max", b'f', 1, Write, 0.0),
    ("pll_kp", b'f', 1, Write, 0.0),
    ("pll_ki", b'f', 1, Write, 0.0),
    ("pll_target_phase", b'f', 1, Write, -90.0),
    ("pll_delay_s", b'f', 1, Write, 0.0),
    ("pll_dc_tau", b'f', 1, Write, 1.0),
    ("pll_demod_tau", b'f', 1, Write, 0.1),
    ("pll_excitation_min", b'f', 1, Write, 0.0),
    ("pll_response_min", b'f', 1, Write, 0.0),
    ("pll_lock_phase_tol", b'f', 1, Write, 5.0),
    ("pll_unlock_phase_tol", b'f', 1, Write, 10.0),
    ("pll_lock_freq_tol", b'f', 1, Write, 0.0),
    ("pll_lock_dwell", b'f', 1, Write, 0.1),
    ("pll_unlock_dwell", b'f', 1, Write, 0.1),
    ("pll_acquire_timeout", b'f', 1, Write, 5.0),
    ("pll_saturation_dwell", b'f', 1, Write, 0.1),
    // Those of the simulated plant.
    ("impacts", b'I', 1, Read, 0.0),
];

impl Parameter {
    fn new((name, code, count, access, value): (&'static str, u8, usize, Access, f32)) -> Self {
        let bytes = match code {
            b'f' => value.to_le_bytes().to_vec(),
            b'H' => (value as u16).to_le_bytes().to_vec(),
            _ => (value as u32).to_le_bytes().to_vec(),
        };
        let value = if access == Block {
            Vec::new()
        } else {
            bytes.repeat(count)
        };
        Self { name, code, count, access, value }
    }

    fn text(name: &'static str, text: &str) -> Self {
        let mut value = text.as_bytes().to_vec();
        value.resize(TEXT, 0);
        Self { name, code: b'c', count: TEXT, access: Read, value }
    }

    /// Its definition for the host.
    fn definition(&self) -> Vec<u8> {
        let count = (self.count as u16).to_le_bytes();
        let writable = u8::from(self.access != Read);
        [self.name.as_bytes(), &[0, self.code], &count, &[writable]].concat()
    }
}

/// All parameters of a device.
#[derive(Debug, Clone)]
pub struct Registry(Vec<Parameter>);

impl Registry {
    /// The parameters of a device at its start.
    pub fn new(experiment: &str) -> Self {
        let texts = [
            ("firmware", concat!("vines ", env!("CARGO_PKG_VERSION"))),
            ("experiment", experiment),
        ];
        let texts = texts.map(|(name, text)| Parameter::text(name, text));
        Self(texts.into_iter().chain(PARAMETERS.map(Parameter::new)).collect())
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// A page of definitions: those from `start` on that fit into a payload.
    pub fn page(&self, start: u16) -> Result<Vec<u8>, ErrorCode> {
        let rest = self.0.get(usize::from(start)..).ok_or(ErrorCode::BadIndex)?;
        let (mut next, mut page) = (start, Vec::new());
        for definition in rest.iter().map(Parameter::definition) {
            if 4 + page.len() + definition.len() > MAX_PAYLOAD {
                break;
            }
            page.extend(definition);
            next += 1;
        }
        Ok([&start.to_le_bytes()[..], &next.to_le_bytes(), &page].concat())
    }

    pub fn at(&self, index: u16) -> Result<&Parameter, ErrorCode> {
        self.0.get(usize::from(index)).ok_or(ErrorCode::BadIndex)
    }

    /// The values of the parameters with these indices.
    pub fn read(&self, indices: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        if indices.is_empty() || !indices.len().is_multiple_of(2) {
            return Err(ErrorCode::BadLength);
        }
        let mut values = Vec::new();
        for index in indices.chunks_exact(2) {
            let parameter = self.at(u16::from_le_bytes([index[0], index[1]]))?;
            values.extend(&parameter.value);
            if parameter.access == Block || values.len() > MAX_PAYLOAD {
                return Err(ErrorCode::BadLength);
            }
        }
        Ok(values)
    }

    /// Writes a parameter. Returns the value before.
    pub fn write(&mut self, index: u16, value: &[u8]) -> Result<Vec<u8>, ErrorCode> {
        let parameter = self.0.get_mut(usize::from(index)).ok_or(ErrorCode::BadIndex)?;
        if parameter.access == Read {
            return Err(ErrorCode::ReadOnly);
        }
        if parameter.access == Block || parameter.value.len() != value.len() {
            return Err(ErrorCode::BadLength);
        }
        if parameter.code == b'f' && !reals(value).iter().all(|value| value.is_finite()) {
            return Err(ErrorCode::BadValue);
        }
        Ok(std::mem::replace(&mut parameter.value, value.to_vec()))
    }

    /// Sets the bytes of a parameter; names are those of the table above.
    pub fn put(&mut self, name: &str, bytes: &[u8]) {
        if let Some(parameter) = self.0.iter_mut().find(|parameter| parameter.name == name) {
            parameter.value = bytes.to_vec();
        }
    }

    /// Sets a real number.
    pub fn put_real(&mut self, name: &str, value: f64) {
        self.put(name, &(value as f32).to_le_bytes());
    }

    /// Sets an integer of four bytes.
    pub fn put_number(&mut self, name: &str, value: u32) {
        self.put(name, &value.to_le_bytes());
    }

    fn value(&self, name: &str) -> &[u8] {
        let found = self.0.iter().find(|parameter| parameter.name == name);
        found.map_or(&[], |parameter| &parameter.value)
    }

    /// The real numbers of a parameter.
    pub fn reals(&self, name: &str) -> Vec<f64> {
        reals(self.value(name)).into_iter().map(f64::from).collect()
    }

    /// A real number.
    pub fn real(&self, name: &str) -> f64 {
        self.reals(name).first().copied().unwrap_or_default()
    }

    /// An integer.
    pub fn number(&self, name: &str) -> u32 {
        let mut word = [0; 4];
        word.iter_mut().zip(self.value(name)).for_each(|(to, from)| *to = *from);
        u32::from_le_bytes(word)
    }
}
