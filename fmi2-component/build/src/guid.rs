//! A GUID that follows from the variable table, so that no library is used with another description.

use std::fmt::Write;

use uuid::Uuid;

use crate::Error;
use crate::table::Table;

/// The namespace of these GUIDs: any fixed one will do.
const NAMESPACE: Uuid = Uuid::from_u128(0x5c1d_1f8e_2f0a_4d5b_9a67_3e1b_7c90_42d1);

/// The GUID of a table. Descriptions have no effect on it: other words do not make another model.
pub(crate) fn guid(table: &Table) -> String {
    let mut text = format!(
        "{}\n{}\n{:?}\n{:?} {}\n",
        table.name, table.identifier, table.categories, table.states, table.event_indicators
    );
    for v in &table.variables {
        let _ = writeln!(
            text,
            "{:?} {} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
            v.name,
            v.value_reference,
            v.kind,
            v.causality,
            v.variability,
            v.initial,
            v.unit,
            v.start,
            v.min,
            v.max,
            v.nominal,
        );
    }
    Uuid::new_v5(&NAMESPACE, text.as_bytes()).to_string()
}

/// The description with the GUID `new` instead of `old`; every other byte stays.
pub(crate) fn replace(xml: &str, old: &str, new: &str) -> Result<String, Error> {
    let before = format!(" guid=\"{old}\"");
    if xml.matches(&before).count() != 1 {
        let fault =
            "fmiModelDescription needs an attribute guid=\"…\", in this spelling, and no other element the same";
        return Err(Error::Faults(vec![fault.into()]));
    }
    Ok(xml.replacen(&before, &format!(" guid=\"{new}\""), 1))
}

#[cfg(test)]
mod tests {
    use super::replace;

    #[test]
    fn only_the_guid_changes() {
        let xml = r#"<!-- guid="no" --><fmiModelDescription modelName="guid='a'" guid="derived" x="1"/>"#;
        let expected = xml.replacen("derived", "42", 1);
        assert_eq!(replace(xml, "derived", "42").unwrap(), expected);
    }

    #[test]
    fn a_guid_that_is_missing_or_not_the_only_one_is_a_fault() {
        for xml in ["<a b='1'/>", r#"<a guid="derived"><b guid="derived"/></a>"#] {
            assert!(replace(xml, "derived", "42").is_err());
        }
    }
}
