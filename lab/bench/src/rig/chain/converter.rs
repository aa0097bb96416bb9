//! A converter between volts and numbers: a step and a range.

/// Rounds to steps within a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Smallest difference, in the unit of the signal.
    step: f64,
    low: f64,
    high: f64,
}

impl Converter {
    /// A converter with this number of bits, from `-range` to `range` minus one step, as in two's complement.
    pub fn new(bits: u32, range: f64) -> Self {
        let step = 2.0 * range / 2_f64.powi(bits as i32);
        Self { step, low: -range, high: range - step }
    }

    pub fn convert(&self, value: f64) -> f64 {
        ((value / self.step).round() * self.step).clamp(self.low, self.high)
    }
}

#[cfg(test)]
#[path = "../../../tests/unit/converter.rs"]
mod tests;
