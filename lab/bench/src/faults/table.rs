//! The faults.

use super::inject::{Kind, Sensor};

/// All faults that need nothing from the program; the sample numbers are a quarter and 37 % of a default period.
pub const FAULTS: [(&str, Kind); 30] = [
    ("response sensor dead", Kind::Response(Sensor::Dead)),
    ("response sensor frozen", Kind::Response(Sensor::Frozen)),
    ("response sensor reversed", Kind::Response(Sensor::Reversed)),
    ("response sensor saturated at half", Kind::Response(Sensor::Saturated)),
    ("response sensor at the end of its range", Kind::Response(Sensor::Stuck)),
    ("response sensor × 3", Kind::Response(Sensor::Gain(3.0))),
    ("response sensor × 0.3", Kind::Response(Sensor::Gain(0.3))),
    ("response sensor with an offset", Kind::Response(Sensor::Offset)),
    ("response sensor noisy", Kind::Response(Sensor::Noisy)),
    ("response sensor loose", Kind::Response(Sensor::Loose)),
    ("response sensor late", Kind::Response(Sensor::Late(25))),
    ("response NaN", Kind::Response(Sensor::Value(f64::NAN))),
    ("response infinite", Kind::Response(Sensor::Value(f64::INFINITY))),
    ("base sensor dead", Kind::Base(Sensor::Dead)),
    ("base sensor frozen", Kind::Base(Sensor::Frozen)),
    ("base sensor reversed", Kind::Base(Sensor::Reversed)),
    ("base sensor saturated at half", Kind::Base(Sensor::Saturated)),
    ("base sensor noisy", Kind::Base(Sensor::Noisy)),
    ("base sensor late", Kind::Base(Sensor::Late(25))),
    ("base NaN", Kind::Base(Sensor::Value(f64::NAN))),
    ("sensors swapped", Kind::Swapped),
    ("both sensors frozen (clock stands still)", Kind::Both(Sensor::Frozen)),
    ("clock jumps back", Kind::Both(Sensor::Late(37))),
    ("clock jumps forward", Kind::Forward(37)),
    ("shaker off", Kind::Shaker(0.0)),
    ("shaker × 5 (overload)", Kind::Shaker(5.0)),
    ("structure changes (lost lock)", Kind::Structure),
    ("rig not heard (lost peer)", Kind::PeerLost),
    ("controller lost (lost peer)", Kind::ControllerLost),
    ("controller asks for NaN", Kind::ControllerNan),
];
