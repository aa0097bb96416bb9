//! What the parameters say, checked as a whole: a value that does not fit the others is refused.

use super::generator::{Series, TableSettings};
use super::pll::PllSettings;
use super::registry::{Registry, WATCHDOG};

/// How the output is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// `target + forcing + table` at the nominal frequency.
    Open = 0,
    /// `forcing` at the frequency of the phase-locked loop.
    Locked = 2,
}

/// The settings of a device.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Nominal frequency, Hz.
    pub frequency: f64,
    /// V
    pub target: Series,
    /// V
    pub forcing: Series,
    pub table: TableSettings,
    pub mode: Mode,
    pub pll: PllSettings,
    pub armed: bool,
    /// Longest silence of the host, s, or 0.
    pub watchdog: f64,
}

impl Settings {
    /// The settings in `registry`, or None if a value is not allowed.
    pub fn of(registry: &Registry) -> Option<Self> {
        let (real, number) = (|name| registry.real(name), |name| registry.number(name));
        let (nyquist, largest) = (0.5 * real("sample_freq"), real("rig_out_max"));
        let series = |name| Series::new(&registry.reals(name));
        let settings = Self {
            frequency: real("freq"),
            target: series("target_coeffs"),
            forcing: series("forcing_coeffs"),
            table: TableSettings {
                frequency: real("table_freq"),
                gain: real("table_gain"),
                linear: number("table_interp") == 1,
                mode: number("table_mode"),
                multiple: number("table_mult"),
                phase: real("table_phase"),
            },
            mode: match number("control_mode") {
                0 => Mode::Open,
                2 => Mode::Locked,
                _ => return None,
            },
            pll: PllSettings::of(real),
            armed: number("arm") == 1,
            watchdog: real(WATCHDOG),
        };
        let frequencies = [settings.frequency, settings.table.frequency];
        let allowed = frequencies.iter().all(|frequency| (0.0..nyquist).contains(frequency))
            && settings.target.bound() <= largest
            && settings.forcing.bound() <= largest
            && number("table_interp") <= 1
            && settings.table.mode <= 4
            && settings.table.multiple >= 1
            && (0.0..1.0).contains(&settings.table.phase)
            && number("arm") <= 1
            && settings.watchdog >= 0.0
            && settings.pll.is_allowed(nyquist);
        allowed.then_some(settings)
    }
}
