//! How soon one impact may follow another: a bound that the events of a step must keep.
//!
//! With `x` the displacement from the held part of the base, `S² = q1'² + omega0² x² + (m/M) q2'²` does not grow at impacts, and
//! `S' <= F` between them, with `F` an upper bound of `|omega0² e + 2 delta e'|` for the moving part of the base. Hence
//! `|w''| <= A = (omega0 + 2 delta) S + F` all through the step. A particle that leaves a wall at the speed `u` needs at least
//! `2 u/A` to come back to it, and to the other wall at least `t` with `u t + A t²/2 = 2 b`.

use lovines::{Drive, Event, Plant, Wall};

/// Rounding of the instants, in units of the step.
const ROUNDING: f64 = 1e-13;

pub struct Spacing {
    acceleration: f64,
    restitution: f64,
    width: f64,
    rounding: f64,
    /// The impact before: instant, wall, and speed after it.
    last: Option<(f64, Wall, f64)>,
    too_close: u64,
}

impl Spacing {
    /// For a step from the plant's present state.
    pub fn of(plant: &Plant, drive: &Drive, step: f64) -> Self {
        let (p, s) = (plant.parameters(), plant.state());
        let omega0 = p.natural_frequency();
        let damping = p.damping / p.primary_mass;
        let [_, u1, u2, u3] = drive.signal.map(f64::abs);
        let (e, de) = (
            drive.amplitude.abs() + step * (u1 + step * (u2 + step * u3)),
            (drive.amplitude * drive.omega).abs() + u1 + step * (2.0 * u2 + step * 3.0 * u3),
        );
        let most_forcing = omega0 * omega0 * e + damping * de;
        let x = s.q1 - drive.signal[0];
        let squares = s.dq1 * s.dq1 + (omega0 * x).powi(2) + p.mass_ratio() * s.dq2 * s.dq2;
        let most = squares.sqrt() + most_forcing * step;
        Self {
            acceleration: (omega0 + damping) * most + most_forcing,
            restitution: p.restitution,
            width: 2.0 * p.half_width,
            rounding: ROUNDING * (step + 1.0 / p.fastest_rate()),
            last: None,
            too_close: 0,
        }
    }

    pub fn see(&mut self, event: &Event) {
        let Event::Impact { t, wall, velocity } = *event else {
            self.last = None;
            return;
        };
        if let Some((before, from, speed)) = self.last {
            let gone = (t - before) * (1.0 + 1e-9) + self.rounding;
            let enough = if wall == from {
                self.acceleration * gone >= 2.0 * speed
            } else {
                gone * (speed + 0.5 * self.acceleration * gone) >= self.width * (1.0 - 1e-9)
            };
            self.too_close += u64::from(!enough);
        }
        self.last = Some((t, wall, self.restitution * velocity.abs()));
    }

    pub fn too_close(&self) -> u64 {
        self.too_close
    }
}

#[test]
fn an_impact_reported_twice_or_too_soon_is_noticed() {
    let start = lovines::State { dq2: 0.5, ..lovines::State::default() };
    let p = lovines::Parameters::dimensionless(0.01, 1.0, 0.65);
    let plant = Plant::new(p, start).expect("valid values");
    let too_close = |second: f64, wall: Wall| {
        let mut spacing = Spacing::of(&plant, &Drive::default(), 10.0);
        for (t, wall) in [(1.0, Wall::Plus), (second, wall)] {
            let velocity = 0.5 * wall.sign();
            spacing.see(&Event::Impact { t, wall, velocity });
        }
        spacing.too_close()
    };
    // S = sqrt(0.01) 0.5 = 0.05 bounds the acceleration; the particle leaves the wall at 0.325.
    assert_eq!(too_close(1.0, Wall::Plus), 1);
    assert_eq!(too_close(1.0 + 1e-6, Wall::Plus), 1);
    assert_eq!(too_close(1.5, Wall::Minus), 1);
    assert_eq!(too_close(20.0, Wall::Plus), 0);
    assert_eq!(too_close(8.0, Wall::Minus), 0);
}
