//! The units of a rig's channels, and what one unit is in the metres of the oscillator that loop, theory and exact orbits are those of.

use vines_rig::unit::Quantity;

/// The unit of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Its symbol: m, N or V.
    pub symbol: &'static str,
    /// A number of units, and the metres of the oscillator that they are. One of the two numbers is 1, so that conversions round once.
    ratio: [f64; 2],
}

impl Unit {
    /// The metre of the oscillator.
    pub(crate) const METRE: Self = Self { symbol: "m", ratio: [1.0; 2] };

    /// The unit that is `metres` metres of the oscillator.
    pub fn of(symbol: &'static str, metres: f64) -> Self {
        Self { symbol, ratio: [1.0, metres] }
    }

    /// The unit of which `units` are a metre of the oscillator.
    pub(crate) fn per_metre(symbol: &'static str, units: f64) -> Self {
        Self { symbol, ratio: [units, 1.0] }
    }

    /// A value in this unit, in metres of the oscillator.
    pub fn in_metres(self, value: f64) -> f64 {
        value * self.ratio[1] / self.ratio[0]
    }

    /// Metres of the oscillator, in this unit.
    pub fn of_metres(self, metres: f64) -> f64 {
        metres * self.ratio[0] / self.ratio[1]
    }

    /// Metres of the oscillator, in this unit and with it.
    pub fn quantity(self, metres: f64) -> Quantity {
        Quantity { value: self.of_metres(metres), unit: self.symbol }
    }

    /// What the amplitude of a drive in this unit is called.
    pub fn amplitude(self) -> &'static str {
        if self.symbol == "N" { "F" } else { "E" }
    }

    /// A drive in this unit, as the motion of a base or as a force: in files they have different names.
    pub fn base_or_force<T>(self, drive: T) -> [Option<T>; 2] {
        match self.symbol {
            "N" => [None, Some(drive)],
            _ => [Some(drive), None],
        }
    }
}

/// The units of what a rig takes and of what its sensors read. Velocities and accelerations have those of the displacement, per s and s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// What the rig is driven with: the reference, or V of a shaker.
    pub command: Unit,
    /// The reference, in which a scene states its drive: the displacement of a base, or a force.
    pub reference: Unit,
    /// The response: a displacement at the sensor.
    pub response: Unit,
}

impl Units {
    /// Those of one oscillator.
    pub(crate) const OSCILLATOR: Self = Self {
        command: Unit::METRE,
        reference: Unit::METRE,
        response: Unit::METRE,
    };
}
