//! The exact orbits of a scene's structure, and where they are looked for.

use vines_model::orbit::{Particle, StructureOrbits};

use super::{Scene, Structure};

impl Scene {
    /// The exact orbits of a structure with the particle of this scene. The response is the displacement at the sensor.
    pub fn orbits_of(&self, structure: &Structure) -> StructureOrbits {
        let particle = Particle {
            mass: self.plant.particle_mass,
            half_width: self.plant.half_width,
            restitution: self.plant.restitution,
        };
        let mut orbits = StructureOrbits::new(&structure.host, particle);
        if let Some(shaker) = &structure.shaker {
            orbits = orbits.with_reference(shaker.reference_and_inertia(structure.excitation));
        }
        orbits
            .with_response(&structure.response())
            .with_target(self.definition().phase)
    }

    /// Amplitude of the drive, or of the reference behind a shaker: m for a base, N for a force.
    pub fn drive(&self) -> f64 {
        self.units().reference.of_metres(self.amplitude)
    }

    /// The frequencies that the controller may set, rad/s.
    pub fn frequencies(&self) -> [f64; 2] {
        [self.controller.omega_min, self.controller.omega_max].map(|share| share * self.plant.natural_frequency())
    }
}
