//! The rigs of the calibration.

/// Settings of a rig.
pub type RigSettings = [&'static str; 4];

/// The rigs: the default one, one with lighter particle and harder walls, one with a heavy particle.
pub const RIGS: [RigSettings; 3] = [
    [
        "plant.epsilon=0.0084",
        "plant.lambda=1.43",
        "plant.r=0.65",
        "excitation.G=1.1",
    ],
    [
        "plant.epsilon=0.0042",
        "plant.lambda=1.0",
        "plant.r=0.8",
        "excitation.G=0.75",
    ],
    [
        "plant.epsilon=0.02",
        "plant.lambda=1.43",
        "plant.r=0.6",
        "excitation.G=1.2",
    ],
];
/// Rigs that were not used while the estimators were written.
pub const OTHER_RIGS: [RigSettings; 3] = [
    [
        "plant.epsilon=0.006",
        "plant.lambda=2.0",
        "plant.r=0.7",
        "excitation.G=1.4",
    ],
    [
        "plant.epsilon=0.012",
        "plant.lambda=0.8",
        "plant.r=0.5",
        "excitation.G=1.1",
    ],
    [
        "plant.epsilon=0.03",
        "plant.lambda=1.2",
        "plant.r=0.75",
        "excitation.G=0.9",
    ],
];
