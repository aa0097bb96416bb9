//! The writer of descriptions.

use fmi2_description::{Description, Element};

const PLANT: &str = include_str!("../../../modelDescription.xml");

#[test]
fn a_description_that_is_read_and_written_says_the_same() {
    let written = Element::parse(PLANT).unwrap().document();
    assert_eq!(
        Description::parse(&written).unwrap(),
        Description::parse(PLANT).unwrap()
    );
    assert_eq!(Element::parse(&written).unwrap().document(), written);
    assert!(Element::parse("<a><b></a>").is_err());
}

#[test]
fn what_is_set_is_escaped_and_what_is_removed_is_gone() {
    let mut root = Element::new("root", &[("a", &1), ("b", &"x")], Vec::new());
    root.set("a", "\"<&>\"");
    root.set("c", 0.5);
    root.remove("b");
    root.child("d").set("e", "é");
    let again = Element::parse(&root.document()).unwrap();
    assert_eq!(again, root);
    assert_eq!((again.get("a"), again.get("b"), again.get("c")), ("\"<&>\"", "", "0.5"));
}
