//! The shape of what the build step generates from `modelDescription.xml`.

use crate::variable::Occasions;
use crate::variable::Variable;

/// A model's identity and its variables; implemented by the generated type `Model`.
pub trait Model: 'static {
    /// `modelName`.
    const NAME: &'static str;
    /// `modelIdentifier`: the name of the FMU and of the library in it.
    const IDENTIFIER: &'static str;
    /// Derived from the variable table: a library meets only the description that it was built with.
    const GUID: &'static str;
    /// The version of the model; a serialised state of another one is refused.
    const VERSION: &'static str;
    /// The continuous states, in the order of the description's list of derivatives.
    const STATES: &'static [Self::Real];
    /// Their derivatives, in the same order.
    const DERIVATIVES: &'static [Self::Real];
    /// `numberOfEventIndicators`.
    const EVENT_INDICATORS: usize;
    /// The names of the log categories.
    const CATEGORIES: &'static [&'static str];
    /// The variables that hold a real number.
    type Real: Key<Value = f64>;
    /// The variables that hold an integer or an enumeration.
    type Integer: Key<Value = i32>;
    /// The Boolean variables.
    type Boolean: Key<Value = bool>;
    /// The variables that hold text.
    type String: Key<Value = &'static str>;
}

/// A variable of one type as a Rust enum, one variant each; generated.
pub trait Key: Copy + 'static {
    /// What start values are made of.
    type Value: 'static;
    /// The table, in the order of the variants.
    const VARIABLES: &'static [Variable<Self::Value>];
    /// All of them, in the same order.
    const ALL: &'static [Self];
    /// When each of them may be set: [`Occasions::table`] of `VARIABLES`.
    const OCCASIONS: &'static [Occasions];

    /// The variable with that value reference.
    fn find(value_reference: u32) -> Option<Self>;

    /// Its place in the table.
    fn index(self) -> usize;

    /// What the description says of it.
    fn variable(self) -> &'static Variable<Self::Value> {
        &Self::VARIABLES[self.index()]
    }
}

/// Whether a master may ever set one of `variables`.
pub(crate) const fn any_settable<T>(variables: &[Variable<T>]) -> bool {
    let mut i = 0;
    while i < variables.len() {
        if variables[i].settable_at_start(false) || variables[i].settable_between_steps() {
            return true;
        }
        i += 1;
    }
    false
}
