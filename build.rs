//! Turns modelDescription.xml into the typed variable table that the FMI binding uses.
fn main() {
    #[cfg(feature = "fmu")]
    fmi2_component_build::generate("modelDescription.xml");
}
