//! What the libraries export.

use fmi2_boundary::{Fmu, Functions};
use object::{Object, ObjectSymbol};

#[test]
fn exactly_the_functions_of_the_standard_are_exported() {
    for name in ["LoViNes", "PhaseLock"] {
        let bytes = std::fs::read(Fmu::path(name)).unwrap();
        let library = object::File::parse(&*bytes).unwrap();
        let defined = library.dynamic_symbols().filter(|s| s.is_definition());
        let mut found: Vec<_> = defined.map(|s| s.name().unwrap().to_owned()).collect();
        found.sort();
        let mut expected = Functions::NAMES.to_vec();
        expected.sort_unstable();
        assert_eq!(found, expected, "{name}");
    }
}
