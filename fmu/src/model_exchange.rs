//! The plant for an integrator: differential equations, event functions and jumps, and derivatives of the outputs.

mod dual;
pub mod equations;
pub mod hybrid;
pub mod rates;
