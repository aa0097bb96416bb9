//! The plant for whoever integrates it: differential equations, event functions and jumps, and derivatives of the outputs.

mod dual;
pub mod equations;
pub mod hybrid;
pub mod rates;
