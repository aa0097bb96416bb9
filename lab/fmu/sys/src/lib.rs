//! The C interface of FMI 2.0, as far as the crate `fmi` uses it.
//!
//! The crate `fmi-sys` has it generated at every build, with that of FMI 3.0, by bindgen and libclang: 30 crates, and a library that
//! few machines have. The standard does not change, so it is written down here (`[patch.crates-io]` in the root's Cargo.toml). Unlike
//! the original, the logger accepts NULL for instance and category.

pub mod fmi2;
