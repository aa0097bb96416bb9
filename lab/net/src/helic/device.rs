//! A rig as a device: requests of the host, and one sample after another.

use super::codec::{ErrorCode, Frame, Status, VERSION, message, reals};
use super::generator::{Table, increment, turns};
use super::pll::{Pll, PllState};
use super::registry::{Access, Registry, TABLE};
use super::settings::{Mode, Settings};
use super::stream::Stream;
use vines_testbench::rig::{Rig, RigError, Sensors};

/// Name of the device.
pub const EXPERIMENT: &str = "vines";
/// Base displacement per volt of the output, mm.
const GAIN: f64 = 1.0;
/// m per mm.
const MILLI: f64 = 1e-3;
/// The command counter is exact as a float.
const EPOCH: u32 = 1 << 24;

/// Bits of the parameter `safety`.
mod safety {
    pub const ARMED: u32 = 1;
    pub const TRIPPED: u32 = 2;
    pub const CLAMPED: u32 = 4;
    pub const QUIETED: u32 = 8;
}

/// Sources of a stream, with their units. A rig without a reference sensor has no `reference`.
const SOURCES: [(&str, &str); 14] = [
    ("response", "mm"),
    ("reference", "mm"),
    ("control_mode", "enum"),
    ("pll_phase", "degree"),
    ("pll_phase_error", "degree"),
    ("pll_exc_amp", "mm"),
    ("pll_resp_amp", "mm"),
    ("pll_freq_actual", "Hz"),
    ("pll_state", "enum"),
    ("target", "V"),
    ("forcing", "V"),
    ("table", "V"),
    ("out", "V"),
    ("cmd_epoch", "count"),
];

/// A device. Everything in it happens at a sample or between two of them, in the order of the calls.
pub struct Device {
    rig: Box<dyn Rig>,
    has_reference: bool,
    pub(super) registry: Registry,
    settings: Settings,
    sample_rate: f64,
    stream: Stream,
    table: Table,
    staged: Vec<f32>,
    /// A table was committed since the last sample.
    committed: bool,
    pll: Pll,
    /// Master phase, and its step to the next sample.
    phase: u32,
    wrapped: bool,
    tripped: bool,
    /// Commands since the last sample.
    commands: u32,
    epoch: u32,
    ticks: u32,
}

impl Device {
    /// The rig `rig` as a device, sampled every `sample_time`, s; its output is limited to `max_amplitude`, m.
    ///
    /// # Errors
    /// A rig that cannot be read.
    pub fn new(mut rig: Box<dyn Rig>, sample_time: f64, max_amplitude: f64) -> Result<Self, RigError> {
        let has_reference = rig.sense()?.reference.is_some();
        let sample_rate = 1.0 / sample_time;
        let mut registry = Registry::new(EXPERIMENT);
        registry.put_real("sample_freq", sample_rate);
        registry.put_real("rig_gain", GAIN);
        registry.put_real("rig_out_max", max_amplitude / (GAIN * MILLI));
        // The values at the start are allowed: a test shows it.
        let settings = Settings::of(&registry).ok_or(RigError::NoHold)?;
        Ok(Self {
            rig,
            has_reference,
            registry,
            settings,
            sample_rate,
            stream: Stream::new(sample_rate),
            table: Table::new(),
            staged: vec![0.0; TABLE],
            committed: false,
            pll: Pll::new(),
            phase: 0,
            wrapped: true,
            tripped: false,
            commands: 0,
            epoch: 0,
            ticks: 0,
        })
    }

    fn sources(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let has_reference = self.has_reference;
        SOURCES
            .into_iter()
            .filter(move |(name, _)| has_reference || *name != "reference")
    }

    /// Answers a request. `uptime` in ms.
    pub fn handle(&mut self, request: &Frame, uptime: u32) -> Frame {
        let Frame { kind, sequence, payload } = request;
        let answer = match self.answer(*kind, payload, uptime) {
            Ok(payload) => (*kind, payload),
            Err(code) => (message::ERROR, vec![code as u8, *kind]),
        };
        Frame { kind: answer.0, sequence: *sequence, payload: answer.1 }
    }

    fn answer(&mut self, kind: u8, payload: &[u8], uptime: u32) -> Result<Vec<u8>, ErrorCode> {
        let empty = || payload.is_empty().then_some(()).ok_or(ErrorCode::BadLength);
        match kind {
            message::GET_PARAMS => {
                let start = payload.try_into().map_err(|_| ErrorCode::BadLength)?;
                return self.registry.page(u16::from_le_bytes(start));
            }
            message::GET_SOURCES => {
                empty()?;
                let entry = |(name, unit): (&str, &str)| format!("{name}\0{unit}\0").into_bytes();
                return Ok(self.sources().flat_map(entry).collect());
            }
            message::GET_PAR => return self.registry.read(payload),
            message::SET_PAR => self.set(payload)?,
            message::SET_BLOCK => self.stage(payload)?,
            message::COMMIT => self.commit(payload)?,
            message::STREAM_SETUP => self.stream.set_up(payload, self.sources().count())?,
            message::STREAM_START => self.stream.start(payload)?,
            message::STREAM_STOP => {
                empty()?;
                self.stream.stop();
            }
            message::STATUS => {
                empty()?;
                let status = Status {
                    version: VERSION,
                    parameters: self.registry.len() as u16,
                    sources: self.sources().count() as u8,
                    sample_rate: self.sample_rate as f32,
                    uptime,
                };
                return Ok(status.encode());
            }
            _ => return Err(ErrorCode::UnknownType),
        }
        Ok(Vec::new())
    }

    /// `index u16, value`.
    fn set(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let (index, value) = payload.split_at_checked(2).ok_or(ErrorCode::BadLength)?;
        let index = u16::from_le_bytes([index[0], index[1]]);
        let before = self.registry.write(index, value)?;
        let parameter = self.registry.at(index)?;
        let (name, pulse) = (parameter.name, parameter.access == Access::Pulse);
        let changed =
            Settings::of(&self.registry).filter(|new| !(self.settings.armed && new.mode != self.settings.mode));
        let Some(settings) = changed else {
            // Not read-only, and of the same length: this cannot fail.
            self.registry.write(index, &before)?;
            return Err(ErrorCode::BadValue);
        };
        let given = !pulse || self.registry.number(name) != 0;
        if pulse {
            self.registry.put_number(name, 0);
        }
        if given && !["arm", "diag_reset"].contains(&name) {
            self.commands += 1;
        }
        if given {
            self.apply(name, settings);
        }
        Ok(())
    }

    /// What a write of `name` does, in addition to the new settings.
    fn apply(&mut self, name: &str, settings: Settings) {
        match name {
            "arm" => {
                // Arming clears an old trip; the loop starts anew, unless its lock was lost.
                self.tripped &= !settings.armed;
                if settings.armed && self.pll.state != PllState::LockLost {
                    self.pll = Pll::new();
                }
            }
            "ctrl_reset" | "control_mode" => self.pll = Pll::new(),
            "pll_reacquire" => self.pll.reacquire(),
            "pll_target_phase" if settings.pll.target != self.settings.pll.target => self.pll.reacquire(),
            "table_trigger" => self.table.trigger(&settings.table),
            "diag_reset" => {
                for name in [
                    "loop_time_max",
                    "clock_jitter",
                    "overruns",
                    "tick_timeouts",
                    "records_dropped",
                    "t_rest_max",
                ] {
                    self.registry.put_number(name, 0);
                }
            }
            _ => {}
        }
        self.settings = settings;
    }

    fn table_at<'a>(&self, payload: &'a [u8]) -> Result<(u32, &'a [u8]), ErrorCode> {
        let Some((&[a, b, c, d, e, f], rest)) = payload.split_first_chunk() else {
            return Err(ErrorCode::BadLength);
        };
        if self.registry.at(u16::from_le_bytes([a, b]))?.access != Access::Block {
            return Err(ErrorCode::BadIndex);
        }
        Ok((u32::from_le_bytes([c, d, e, f]), rest))
    }

    /// `index u16, offset u32, data`.
    fn stage(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let (offset, data) = self.table_at(payload)?;
        if data.is_empty() || !data.len().is_multiple_of(4) {
            return Err(ErrorCode::BadLength);
        }
        if self.committed {
            return Err(ErrorCode::Busy);
        }
        let values = reals(data);
        let place = usize::try_from(offset)
            .ok()
            .and_then(|at| self.staged.get_mut(at..)?.get_mut(..values.len()));
        place.ok_or(ErrorCode::BadLength)?.copy_from_slice(&values);
        Ok(())
    }

    /// `index u16, length u32`.
    fn commit(&mut self, payload: &[u8]) -> Result<(), ErrorCode> {
        let (length, rest) = self.table_at(payload)?;
        if !rest.is_empty() {
            return Err(ErrorCode::BadLength);
        }
        let length = length as usize;
        if !(2..=TABLE).contains(&length) || !self.staged[..length].iter().all(|value| value.is_finite()) {
            return Err(ErrorCode::BadValue);
        }
        if self.committed {
            return Err(ErrorCode::Busy);
        }
        self.table.values = self.staged[..length].to_vec();
        self.registry.put_short("table_len", length as u16);
        self.committed = true;
        self.commands += 1;
        Ok(())
    }

    /// The host has left: output and stream stop.
    pub fn disconnect(&mut self) {
        self.stream.stop();
        self.registry.put_number("arm", 0);
        self.settings.armed = false;
    }

    /// Whether the output may be other than zero.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.settings.armed && !self.tripped
    }

    /// One sample: reads the sensors, drives the rig until the next sample, and returns a packet for a port of the host if one is complete.
    ///
    /// # Errors
    /// Those of the rig; it cannot be driven by samples, for example.
    pub fn tick(&mut self) -> Result<Option<(u16, Vec<u8>)>, RigError> {
        let Sensors { response, reference } = self.rig.sense()?;
        self.epoch = (self.epoch + std::mem::take(&mut self.commands)) % EPOCH;
        self.committed = false;
        let step = 1.0 / self.sample_rate;
        let locking = self.is_driven() && self.settings.mode == Mode::Locked;
        let nominal = increment(self.settings.frequency, self.sample_rate);
        let [target, forcing] = [&self.settings.target, &self.settings.forcing].map(|series| series.at(self.phase));
        let master = (self.phase, nominal);
        let table = self
            .table
            .next(&self.settings.table, self.sample_rate, master, self.wrapped);
        let wanted = match self.settings.mode {
            Mode::Open => target + forcing + table,
            Mode::Locked => forcing,
        };
        let actual = if locking && self.pll.frequency.is_finite() {
            self.pll.frequency
        } else {
            self.settings.frequency
        };
        let mut readings = [forcing, response / MILLI];
        if let Some(reference) = reference {
            readings[0] = reference / MILLI;
        }
        if locking {
            self.pll.update(&self.settings.pll, turns(self.phase), readings, step);
            // Quiet at once, and from now on.
            self.tripped |= self.pll.state == PllState::LockLost;
        }
        let out = self.gate(wanted);
        let lock = &self.pll;
        let values = [
            readings[1],
            readings[0],
            f64::from(self.settings.mode as u8),
            lock.phase[0],
            lock.phase[1],
            lock.amplitudes[0],
            lock.amplitudes[1],
            actual,
            f64::from(lock.state as u8),
            target,
            forcing,
            table,
            out,
            f64::from(self.epoch),
        ];
        let from = usize::from(!self.has_reference);
        let shown: Vec<f64> = values[..1].iter().chain(&values[1 + from..]).copied().collect();
        let packet = self.stream.record(self.ticks, &shown);
        self.rig.hold(out * GAIN * MILLI, step)?;
        let step = if locking {
            increment(self.pll.frequency, self.sample_rate)
        } else {
            nominal
        };
        (self.phase, self.wrapped) = self.phase.overflowing_add(step);
        self.ticks = self.ticks.wrapping_add(1);
        self.registry.put_number("ticks", self.ticks);
        if let Some(inside) = self.rig.ground_truth()? {
            self.registry.put_number("impacts", inside.impacts as u32);
        }
        Ok(packet)
    }

    /// The output, V: nothing unless armed, and never more than the limit.
    fn gate(&mut self, wanted: f64) -> f64 {
        let largest = self.registry.real("rig_out_max");
        let quiet = !self.is_driven() || !wanted.is_finite();
        let out = if quiet { 0.0 } else { wanted.clamp(-largest, largest) };
        let bits = [
            (self.settings.armed, safety::ARMED),
            (self.tripped, safety::TRIPPED),
            (!quiet && out != wanted, safety::CLAMPED),
            (quiet, safety::QUIETED),
        ];
        let bits = bits.iter().filter(|(set, _)| *set).map(|(_, bit)| bit).sum();
        self.registry.put_number("safety", bits);
        out
    }
}
