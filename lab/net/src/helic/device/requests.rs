//! The requests of the host.

use super::super::codec::{ErrorCode, Frame, Status, VERSION, message, reals};
use super::super::pll::{Pll, PllState};
use super::super::registry::{Access, REBOOT, TABLE, WATCHDOG};
use super::super::settings::Settings;
use super::Device;

impl Device {
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
            message::SET_PAR => self.set(payload, uptime)?,
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
        let (index, value) = payload.split_at_checked(2).ok_or(ErrorCode::BadLength)?;
        let index = u16::from_le_bytes([index[0], index[1]]);
        let before = self.registry.write(index, value)?;
        let parameter = self.registry.at(index)?;
        let (name, pulse) = (parameter.name, parameter.access == Access::Pulse);
        if name == "mcu_reboot" {
            let confirmed = self.registry.number(name) == REBOOT;
            self.registry.put_number(name, 0);
            return confirmed.then(|| self.reboot(uptime)).ok_or(ErrorCode::BadValue);
        }
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
        if given && !["arm", "diag_reset", WATCHDOG].contains(&name) {
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
                let counters = "loop_time_max clock_jitter overruns tick_timeouts records_dropped t_rest_max";
                counters.split(' ').for_each(|name| self.registry.put_number(name, 0));
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
        self.registry.put("table_len", &(length as u16).to_le_bytes());
        self.committed = true;
        self.commands += 1;
        Ok(())
    }
}
