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
mod tests {
    use super::*;

    #[test]
    fn three_bits_have_eight_values() {
        let converter = Converter::new(3, 1.0);
        let mut seen: Vec<f64> = (-300..300).map(|n| converter.convert(f64::from(n) / 100.0)).collect();
        seen.dedup();
        assert_eq!(seen, [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75]);
    }
}
