//! Causality, variability and initial: their names, their defaults, and which go together (FMI 2.0, clause 2.2.7).

/// Declares an attribute's values under the names they have in XML.
macro_rules! attribute {
    ($(#[$note:meta])* $name:ident { $($value:ident = $text:literal),* $(,)? }) => {
        $(#[$note])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum $name { $($value),* }

        impl $name {
            pub const NAMES: &[&str] = &[$($text),*];

            pub fn parse(text: &str) -> Option<Self> {
                match text {
                    $($text => Some(Self::$value),)*
                    _ => None,
                }
            }
        }
    };
}

attribute! {
    /// Who determines the value.
    Causality {
        Parameter = "parameter",
        CalculatedParameter = "calculatedParameter",
        Input = "input",
        Output = "output",
        Local = "local",
        Independent = "independent",
    }
}

attribute! {
    /// When the value may change.
    Variability {
        Constant = "constant",
        Fixed = "fixed",
        Tunable = "tunable",
        Discrete = "discrete",
        Continuous = "continuous",
    }
}

attribute! {
    /// How the initial value is found.
    Initial {
        Exact = "exact",
        Approx = "approx",
        Calculated = "calculated",
    }
}

/// The values of `initial` that a causality and a variability allow, the default first; none where the standard forbids
/// the pair. `None` stands for the attribute being absent.
pub(crate) fn allowed(causality: Causality, variability: Variability) -> &'static [Option<Initial>] {
    use Causality as C;
    use Initial::{Approx, Calculated, Exact};
    use Variability as V;
    match (causality, variability) {
        (C::Output | C::Local, V::Constant) => &[Some(Exact)],
        (C::Parameter, V::Fixed | V::Tunable) => &[Some(Exact)],
        (C::CalculatedParameter | C::Local, V::Fixed | V::Tunable) => &[Some(Calculated), Some(Approx)],
        (C::Input, V::Discrete | V::Continuous) | (C::Independent, V::Continuous) => &[None],
        (C::Output | C::Local, V::Discrete | V::Continuous) => &[Some(Calculated), Some(Exact), Some(Approx)],
        _ => &[],
    }
}
