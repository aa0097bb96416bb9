//! Tests of `pack/platform`.

use super::*;

const X86: u32 = 0x0100_0007;
const ARM: u32 = 0x0100_000c;

/// The header of a library for macOS, with no load commands.
fn library(processor: u32) -> Vec<u8> {
    let words = [0xfeed_facf, processor, 0, 6, 0, 0, 0, 0];
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Several of them in one file.
fn universal(processors: &[u32]) -> Vec<u8> {
    let libraries: Vec<_> = processors.iter().map(|&one| (one, library(one))).collect();
    let mut words = vec![0xcafe_babe, processors.len() as u32];
    let mut offset = 8 + 20 * processors.len() as u32;
    for (processor, library) in &libraries {
        let size = library.len() as u32;
        words.extend([*processor, 0, offset, size, 0]);
        offset += size;
    }
    let header = words.into_iter().flat_map(u32::to_be_bytes);
    let bodies = libraries.into_iter().flat_map(|(_, library)| library);
    header.chain(bodies).collect()
}

fn fits(folder: &str, file: &[u8]) -> bool {
    Platform::of_folder(folder).unwrap().mismatch(file).is_none()
}

#[test]
fn a_folder_for_macos_takes_what_masters_look_for_there() {
    for (file, darwin64, aarch64) in [
        (library(X86), true, false),
        (library(ARM), true, true),
        (universal(&[X86, ARM]), true, true),
        (universal(&[X86]), true, false),
    ] {
        assert_eq!(fits("darwin64", &file), darwin64);
        assert_eq!(fits("aarch64-darwin", &file), aarch64);
        assert!(!fits("linux64", &file) && !fits("win64", &file));
    }
    assert!(!fits("darwin64", &universal(&[])));
}

#[test]
fn a_library_for_apple_silicon_has_a_second_folder_and_no_other_has() {
    for platform in KNOWN {
        let also = platform.also().map(|other| other.folder);
        let expected = match (platform.folder, platform.architecture) {
            ("aarch64-darwin", _) => Some("darwin64"),
            ("darwin64", Aarch64) => Some("aarch64-darwin"),
            _ => None,
        };
        assert_eq!(also, expected, "{}", platform.folder);
    }
}
