//! A rig as a device: requests of the host, and one sample after another.

use std::f64::consts::TAU;

use super::codec::{ErrorCode, Frame, Status, VERSION, message};
use super::pll::Pll;
use super::registry::{HARMONICS, Registry, WATCHDOG};
use super::stream::Stream;
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};

/// Base displacement per volt of the output, mm.
const GAIN: f64 = 1.0;
/// m per mm.
const MILLI: f64 = 1e-3;
/// Turns of the phase accumulator per turn of the phase.
const TURN: f64 = 4_294_967_296.0;
/// The command counter is exact as a float.
const EPOCH: u32 = 1 << 24;
/// The value of `mcu_reboot` that restarts a device.
const REBOOT: u32 = 0x5245_4254;

/// Sources of a stream, with their units. A rig without a reference sensor has no `reference`, which is the last.
const SOURCES: [(&str, &str); 14] = [
    ("response", "mm"),
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
const REFERENCE: (&str, &str) = ("reference", "mm");

/// A device. Everything in it happens at a sample or between two of them, in the order of the calls.
pub struct Device {
    rig: Box<dyn Rig>,
    has_reference: bool,
    sample_rate: f64,
    registry: Registry,
    stream: Stream,
    /// The loop: present while the output is armed in `control_mode` 2, and after a lost lock.
    pll: Option<Pll>,
    tripped: bool,
    /// Master phase.
    phase: u32,
    ticks: u32,
    /// Commands since the last sample, and up to it.
    commands: u32,
    epoch: u32,
    /// Samples since the last request.
    silence: u32,
    /// Time of the last reboot, ms, and whether it has just happened.
    booted: u32,
    rebooted: bool,
}

impl Device {
    /// The rig `rig` as a device, sampled every `sample_time`, s; its output is limited to `max_amplitude`, m.
    pub fn new(mut rig: Box<dyn Rig>, sample_time: f64, max_amplitude: f64) -> Result<Self, RigError> {
        let sample_rate = 1.0 / sample_time;
        Ok(Self {
            has_reference: rig.sense()?.reference.is_some(),
            rig,
            sample_rate,
            registry: Registry::new(sample_rate, GAIN, max_amplitude / (GAIN * MILLI)),
            stream: Stream::new(sample_rate),
            pll: None,
            tripped: false,
            phase: 0,
            ticks: 0,
            commands: 0,
            epoch: 0,
            silence: 0,
            booted: 0,
            rebooted: false,
        })
    }

    /// Starts again with the values of the start, at `uptime`, ms. The rig and its motion stay as they are.
    fn reboot(&mut self, uptime: u32) {
        self.registry = Registry::new(self.sample_rate, GAIN, self.registry.real("rig_out_max"));
        (self.stream, self.pll, self.tripped) = (Stream::new(self.sample_rate), None, false);
        (self.phase, self.ticks, self.commands, self.epoch) = (0, 0, 0, 0);
        (self.booted, self.rebooted) = (uptime, true);
    }

    /// Whether the device has restarted since the last call: the connection to its host is not valid any more.
    pub fn has_rebooted(&mut self) -> bool {
        std::mem::take(&mut self.rebooted)
    }

    /// The host has left: output and stream stop.
    pub fn disconnect(&mut self) {
        self.stream.stop();
        self.disarm();
    }

    fn disarm(&mut self) {
        self.registry.put("arm", &[0.0]);
        self.pll.take_if(|pll| !pll.is_lost());
    }

    /// Arms the output, which clears a trip unless the lock was lost; the loop starts anew. False if its parameters do not fit together.
    fn arm(&mut self) -> bool {
        self.tripped = false;
        if self.is_locked_mode() {
            if self.pll.as_ref().is_some_and(Pll::is_lost) {
                self.tripped = true;
                return true;
            }
            self.pll = Pll::new(&self.registry).ok();
            return self.pll.is_some();
        }
        true
    }

    fn is_armed(&self) -> bool {
        self.registry.real("arm") == 1.0
    }

    fn is_locked_mode(&self) -> bool {
        self.registry.real("control_mode") == 2.0
    }

    /// Whether the output may be other than zero.
    pub fn is_driven(&self) -> bool {
        self.is_armed() && !self.tripped
    }

    fn sources(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let [first, rest @ ..] = SOURCES;
        [first]
            .into_iter()
            .chain(self.has_reference.then_some(REFERENCE))
            .chain(rest)
    }

    /// Answers a request. `uptime` in ms.
    pub fn handle(&mut self, request: &Frame, uptime: u32) -> Frame {
        let Frame { kind, sequence, ref payload } = *request;
        self.silence = 0;
        let (kind, payload) = match self.answer(kind, payload, uptime) {
            Ok(payload) => (kind, payload),
            Err(code) => (message::ERROR, vec![code as u8, kind]),
        };
        Frame { kind, sequence, payload }
    }

    fn answer(&mut self, kind: u8, payload: &[u8], uptime: u32) -> Result<Vec<u8>, ErrorCode> {
        if matches!(kind, message::GET_SOURCES | message::STREAM_STOP | message::STATUS) && !payload.is_empty() {
            return Err(ErrorCode::BadLength);
        }
        match kind {
            message::GET_PARAMS => {
                let start = payload.try_into().map_err(|_| ErrorCode::BadLength)?;
                return self.registry.page(u16::from_le_bytes(start));
            }
            message::GET_SOURCES => {
                let entry = |(name, unit): (&str, &str)| format!("{name}\0{unit}\0").into_bytes();
                return Ok(self.sources().flat_map(entry).collect());
            }
            message::GET_PAR => return self.registry.read(payload),
            message::SET_PAR => self.set(payload, uptime)?,
            message::STREAM_SETUP => self.stream.set_up(payload, self.sources().count())?,
            message::STREAM_START => self.stream.start(payload)?,
            message::STREAM_STOP => self.stream.stop(),
            message::STATUS => {
                let status = Status {
                    version: VERSION,
                    parameters: self.registry.len() as u16,
                    sources: self.sources().count() as u8,
                    sample_rate: self.sample_rate as f32,
                    uptime: uptime.wrapping_sub(self.booted),
                };
                return Ok(status.encode());
            }
            _ => return Err(ErrorCode::UnknownType),
        }
        Ok(Vec::new())
    }

    /// `index u16, value`.
    fn set(&mut self, payload: &[u8], uptime: u32) -> Result<(), ErrorCode> {
        let (index, bytes) = payload.split_first_chunk().ok_or(ErrorCode::BadLength)?;
        let (name, values) = self.registry.writing(u16::from_le_bytes(*index), bytes)?;
        let (value, refused) = (values[0], Err(ErrorCode::BadValue));
        match name {
            "mcu_reboot" if value != f64::from(REBOOT) => return refused,
            "mcu_reboot" => self.reboot(uptime),
            "ctrl_reset" if value != 0.0 => {
                self.pll = self.pll.take().and_then(|_| Pll::new(&self.registry).ok());
                self.commands += 1;
            }
            // Commands that have nothing to do here.
            "ctrl_reset" | "table_trigger" | "diag_reset" => {}
            "control_mode" if self.is_armed() && value != self.registry.real(name) => return refused,
            _ => {
                let before = self.registry.values(name).to_vec();
                self.registry.put(name, &values);
                let fits = match (name, &mut self.pll) {
                    ("arm", _) if value == 1.0 => self.arm(),
                    ("arm", _) => {
                        self.disarm();
                        true
                    }
                    (name, Some(pll)) if !pll.is_lost() && (name.starts_with("pll_") || name == "forcing_coeffs") => {
                        pll.configure(&self.registry).is_ok()
                    }
                    _ => true,
                };
                if !fits {
                    self.registry.put(name, &before);
                    return refused;
                }
                self.commands += u32::from(!["arm", WATCHDOG].contains(&name));
            }
        }
        Ok(())
    }

    /// One sample: reads the sensors, drives the rig until the next sample, and returns a packet for a port of the host if one is complete.
    pub fn tick(&mut self) -> Result<Option<(u16, Vec<u8>)>, RigError> {
        let Sensors { response, reference } = self.rig.sense()?;
        let step = 1.0 / self.sample_rate;
        self.epoch = (self.epoch + std::mem::take(&mut self.commands)) % EPOCH;
        self.silence = self.silence.saturating_add(1);
        let watchdog = self.registry.real(WATCHDOG);
        if watchdog > 0.0 && f64::from(self.silence) * step > watchdog {
            self.disarm();
        }
        let series = ["target_coeffs", "forcing_coeffs"].map(|name| series(self.registry.values(name), self.phase));
        let ([target, forcing], response) = (series, response / MILLI);
        let excitation = reference.map_or(GAIN * forcing, |base| base / MILLI);
        let [nominal, mode] = ["freq", "control_mode"].map(|name| self.registry.real(name));
        // Up to this sample, and from it on.
        let mut frequencies = [nominal; 2];
        if self.is_driven()
            && let Some(pll) = &mut self.pll
        {
            frequencies[0] = pll.frequency();
            pll.update(response, excitation);
            frequencies[1] = pll.frequency();
            // Quiet at once, and from now on.
            self.tripped |= pll.is_lost();
        }
        let out = self.gate(if self.is_locked_mode() {
            forcing
        } else {
            target + forcing
        });
        let unlocked = ([f64::NAN, f64::NAN, 0.0, 0.0], 0.0);
        let (of_pll, state) = self.pll.as_ref().map_or(unlocked, Pll::sources);
        let turns = f64::from(self.phase) / TURN;
        let mut values = vec![response];
        values.extend(self.has_reference.then_some(excitation));
        values.push(mode);
        values.extend(of_pll);
        values.extend([
            frequencies[0],
            state,
            target,
            forcing,
            0.0,
            turns,
            out,
            f64::from(self.epoch),
        ]);
        let packet = self.stream.record(self.ticks, &values);
        let displacement = out * GAIN * MILLI;
        self.rig.hold(Drive { displacement, ..Drive::default() }, step)?;
        self.phase = self.phase.wrapping_add((frequencies[1] * step * TURN).round() as u32);
        self.ticks = self.ticks.wrapping_add(1);
        self.registry.put("ticks", &[self.ticks.into()]);
        if let Some(inside) = self.rig.ground_truth()? {
            self.registry.put("impacts", &[f64::from(inside.impacts as u32)]);
        }
        Ok(packet)
    }

    /// The output, V: nothing unless armed, and never more than the limit.
    fn gate(&mut self, wanted: f64) -> f64 {
        let largest = self.registry.real("rig_out_max");
        let quiet = !self.is_driven() || !wanted.is_finite();
        let out = if quiet { 0.0 } else { wanted.clamp(-largest, largest) };
        // Bits 0 to 3: armed, tripped, limited, quiet.
        let bits = [self.is_armed(), self.tripped, !quiet && out != wanted, quiet];
        let safety: u8 = bits.iter().rev().fold(0, |bits, bit| 2 * bits + u8::from(*bit));
        self.registry.put("safety", &[safety.into()]);
        out
    }
}

/// Value of a Fourier series, mean, cosines and sines, at a phase of its fundamental.
fn series(coefficients: &[f64], phase: u32) -> f64 {
    let (cosines, sines) = coefficients[1..].split_at(HARMONICS);
    let harmonic = |(k, (a, b)): (usize, (&f64, &f64))| {
        if *a == 0.0 && *b == 0.0 {
            return 0.0;
        }
        let (sine, cosine) = (TAU * f64::from(phase.wrapping_mul(k as u32 + 1)) / TURN).sin_cos();
        a * cosine + b * sine
    };
    coefficients[0] + cosines.iter().zip(sines).enumerate().map(harmonic).sum::<f64>()
}
