//! Compiles the logger.

fn main() {
    println!("cargo::rerun-if-changed=src/logger.c");
    cc::Build::new().file("src/logger.c").compile("vines_fmu_logger");
}
