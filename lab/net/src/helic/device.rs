//! A rig as a device: requests of the host, and one sample after another.

mod requests;

use super::generator::{Table, increment, turns};
use super::pll::{Pll, PllState};
use super::registry::{Registry, TABLE};
use super::settings::{Mode, Settings};
use super::stream::Stream;
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};

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
const SOURCES: [(&str, &str); 15] = [
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
    ("phase", "turns"),
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
    /// Samples since the last request.
    silence: u32,
    /// Time of the last reboot, ms, and whether it has just happened.
    booted: u32,
    rebooted: bool,
}

impl Device {
    /// The rig `rig` as a device, sampled every `sample_time`, s; its output is limited to `max_amplitude`, m.
    pub fn new(mut rig: Box<dyn Rig>, sample_time: f64, max_amplitude: f64) -> Result<Self, RigError> {
        let has_reference = rig.sense()?.reference.is_some();
        let sample_rate = 1.0 / sample_time;
        let registry = start_values(sample_rate, max_amplitude / (GAIN * MILLI));
        // The values at the start are allowed: a test shows it.
        let settings = Settings::of(&registry).ok_or(RigError::NoHold)?;
        Ok(Self {
            rig,
            has_reference,
            registry,
            settings,
            sample_rate,
            stream: Stream::new(sample_rate),
            table: Table::default(),
            staged: vec![0.0; TABLE],
            committed: false,
            pll: Pll::new(),
            phase: 0,
            wrapped: true,
            tripped: false,
            commands: 0,
            epoch: 0,
            ticks: 0,
            silence: 0,
            booted: 0,
            rebooted: false,
        })
    }

    /// Starts again with the values of the start, at `uptime`, ms. The rig and its motion stay as they are.
    fn reboot(&mut self, uptime: u32) {
        self.registry = start_values(self.sample_rate, self.registry.real("rig_out_max"));
        if let Some(settings) = Settings::of(&self.registry) {
            self.settings = settings;
        }
        (self.stream, self.table, self.pll) = (Stream::new(self.sample_rate), Table::default(), Pll::new());
        self.staged.fill(0.0);
        (self.committed, self.wrapped, self.tripped) = (false, true, false);
        (self.phase, self.commands, self.epoch, self.ticks) = (0, 0, 0, 0);
        (self.booted, self.rebooted) = (uptime, true);
    }

    /// Whether the device has restarted since the last call: the connection to its host is not valid any more.
    pub fn has_rebooted(&mut self) -> bool {
        std::mem::take(&mut self.rebooted)
    }

    fn sources(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let has_reference = self.has_reference;
        SOURCES
            .into_iter()
            .filter(move |(name, _)| has_reference || *name != "reference")
    }

    /// The host has left: output and stream stop.
    pub fn disconnect(&mut self) {
        self.stream.stop();
        self.disarm();
    }

    fn disarm(&mut self) {
        self.registry.put_number("arm", 0);
        self.settings.armed = false;
    }

    /// Whether the output may be other than zero.
    pub fn is_driven(&self) -> bool {
        self.settings.armed && !self.tripped
    }

    /// One sample: reads the sensors, drives the rig until the next sample, and returns a packet for a port of the host if one is complete.
    pub fn tick(&mut self) -> Result<Option<(u16, Vec<u8>)>, RigError> {
        let Sensors { response, reference } = self.rig.sense()?;
        self.epoch = (self.epoch + std::mem::take(&mut self.commands)) % EPOCH;
        self.committed = false;
        let step = 1.0 / self.sample_rate;
        self.silence = self.silence.saturating_add(1);
        let watchdog = self.settings.watchdog;
        if watchdog > 0.0 && f64::from(self.silence) * step > watchdog {
            self.disarm();
        }
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
        let readings = [reference.map_or(forcing, |base| base / MILLI), response / MILLI];
        if locking {
            self.pll.update(&self.settings.pll, turns(self.phase), readings, step);
            // Quiet at once, and from now on.
            self.tripped |= self.pll.state == PllState::LockLost;
        }
        let out = self.gate(wanted);
        let values = self.values(readings, actual, [target, forcing, table, out]);
        let from = usize::from(!self.has_reference);
        let shown: Vec<f64> = values[..1].iter().chain(&values[1 + from..]).copied().collect();
        let packet = self.stream.record(self.ticks, &shown);
        let displacement = out * GAIN * MILLI;
        self.rig.hold(Drive { displacement, ..Drive::default() }, step)?;
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

    /// The values of all sources: `readings` of reference and response, mm, the frequency, Hz, and target, forcing, table and output, V.
    fn values(&self, readings: [f64; 2], actual: f64, [target, forcing, table, out]: [f64; 4]) -> [f64; 15] {
        let lock = &self.pll;
        [
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
            turns(self.phase),
            out,
            f64::from(self.epoch),
        ]
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

/// The parameters of a device at its start; its output is limited to `largest`, V.
fn start_values(sample_rate: f64, largest: f64) -> Registry {
    let mut registry = Registry::new(EXPERIMENT);
    registry.put_real("sample_freq", sample_rate);
    registry.put_real("rig_gain", GAIN);
    registry.put_real("rig_out_max", largest);
    registry
}
