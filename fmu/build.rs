//! Turns modelDescription.xml into the typed variable table that the binding uses.
fn main() {
    fmi2_component_build::generate("../modelDescription.xml");
}
