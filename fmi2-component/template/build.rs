//! Turns the model description into the variable table.

fn main() {
    fmi2_component_build::generate("modelDescription.xml");
}
