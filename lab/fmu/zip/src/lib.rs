//! The crate `fmi` unpacks FMUs with version 8 of the crate `zip` and all of its compressions and ciphers, one of them in C. They
//! took a quarter of the build. FMI 2.0 (section 2.2) allows only "deflate" and no encryption: version 9 with that compression,
//! which the program also packs with, replaces it (`[patch.crates-io]` in the root's Cargo.toml).

pub use zip9::*;
