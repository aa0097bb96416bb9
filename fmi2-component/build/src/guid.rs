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

/// The description with another GUID; every other byte stays.
pub(crate) fn replace(xml: &str, guid: &str) -> Result<String, Error> {
    let value =
        guid_value(xml).ok_or_else(|| Error::Faults(vec!["fmiModelDescription has no attribute guid".into()]))?;
    Ok([&xml[..value.start], guid, &xml[value.end..]].concat())
}

/// Where the value of the root's attribute `guid` stands.
fn guid_value(xml: &str) -> Option<std::ops::Range<usize>> {
    let mut at = root(xml)? + "<fmiModelDescription".len();
    loop {
        let rest = &xml[at..];
        let equals = rest.find('=')?;
        let name = rest[..equals].trim();
        let open = equals + rest[equals..].find(['"', '\''])?;
        let quote = char::from(rest.as_bytes()[open]);
        let close = open + 1 + rest[open + 1..].find(quote)?;
        if name == "guid" {
            return Some(at + open + 1..at + close);
        }
        at += close + 1;
    }
}

/// Where the root element begins: not inside a comment before it.
fn root(xml: &str) -> Option<usize> {
    let mut at = 0;
    loop {
        let element = at + xml[at..].find("<fmiModelDescription")?;
        match xml[at..element].find("<!--") {
            None => return Some(element),
            Some(comment) => at += comment + xml[at + comment..].find("-->")? + 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::replace;

    #[test]
    fn only_the_guid_of_the_root_changes() {
        let xml = r#"<!-- <fmiModelDescription guid="no"> -->
            <fmiModelDescription modelName="guid='a'" guid = 'derived' x="1"><A guid="derived"/></fmiModelDescription>"#;
        let expected = xml.replacen("'derived'", "'42'", 1);
        assert_eq!(replace(xml, "42").unwrap(), expected);
    }

    #[test]
    fn a_missing_guid_is_a_fault() {
        assert!(replace("<fmiModelDescription a='1'/>", "42").is_err());
    }
}
