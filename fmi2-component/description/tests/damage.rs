//! Damaged descriptions: an error, or a description, and never a panic.

use fastrand::Rng;
use fmi2_description::Description;

const DESCRIPTIONS: [&[u8]; 3] = [
    include_bytes!("../../../modelDescription.xml"),
    include_bytes!("../../../controller/modelDescription.xml"),
    include_bytes!("../../example/modelDescription.xml"),
];
/// What damages XML and numbers.
const PIECES: [&[u8]; 14] = [
    b"<",
    b">",
    b"\"",
    b"&",
    b"&#0;",
    b"&#x110000;",
    b"<![CDATA[",
    b"<!DOCTYPE a [<!ENTITY b '&b;'>]>",
    b"<?xml version='1.0' encoding='UTF-16'?>",
    b" index=\"99999999999999999999\"",
    b"\0",
    b"\xff\xfe",
    b"-0",
    b"\xe2\x80",
];

#[test]
fn a_damaged_description_is_an_error_or_a_description_and_never_a_panic() {
    let most =
        std::env::var("DAMAGED_DESCRIPTIONS").map_or(1000, |text| text.parse().expect("a number of descriptions"));
    let seed = std::env::var("SEED").map_or(1, |text| text.parse().expect("a seed"));
    let mut random = Rng::with_seed(seed);
    let mut counts = [0_u64; 2];
    for _ in 0..most {
        let mut text = DESCRIPTIONS[random.usize(..3)].to_vec();
        // A part of it, so that the head is damaged as often as the variables.
        if random.bool() {
            text.truncate(random.usize(200..text.len()));
            text.extend(b"</ModelVariables><ModelStructure/></fmiModelDescription>");
        }
        for _ in 0..random.usize(..6) {
            let at = random.usize(..text.len());
            match random.usize(..4) {
                0 => text[at] = random.u8(..),
                1 => drop(text.drain(at..(at + random.usize(..40)).min(text.len()))),
                2 => drop(text.splice(at..at, PIECES[random.usize(..PIECES.len())].iter().copied())),
                _ => {
                    let part = text[at..(at + random.usize(..200)).min(text.len())].to_vec();
                    let to = random.usize(..text.len());
                    drop(text.splice(to..to, part));
                }
            }
            if text.is_empty() {
                break;
            }
        }
        counts[usize::from(Description::read(&text).is_ok())] += 1;
    }
    println!("{} damaged descriptions are refused, {} are read", counts[0], counts[1]);
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}
