//! The folder of an FMU's resources (FMI 2.0, clause 2.1.5), in any notation in which masters give it.

use std::path::{Path, PathBuf};

use crate::refusal::Refusal;

/// No resource is larger: a component reads descriptions, not recordings.
const LARGEST_RESOURCE: u64 = 1 << 26;

/// The files in the folder `resources/` of an unpacked FMU.
#[derive(Debug)]
pub struct Resources {
    /// `fmuResourceLocation`, for messages.
    given: Option<String>,
    /// Where the folder may be, the most probable place first.
    places: Vec<PathBuf>,
}

impl Resources {
    /// `file:///…` with any number of slashes or a host, encoded or not, or a bare path; NULL: no folder.
    pub(crate) fn at(location: Option<&str>) -> Self {
        let text = location.unwrap_or_default();
        let path = path_of(text);
        // A name may contain what looks like an encoded byte, and some masters encode nothing.
        let mut texts = vec![decoded(&path), Some(path.clone()), Some(text.to_owned())];
        texts.dedup();
        // Some masters give the folder of the FMU.
        let places = texts.into_iter().flatten().filter(|text| !text.is_empty());
        let places = places.flat_map(|text| [PathBuf::from(&text), Path::new(&text).join("resources")]);
        Self { given: location.map(str::to_owned), places: places.collect() }
    }

    /// The content of a file.
    ///
    /// # Errors
    /// No location, no such file, one that cannot be read, or one that is too large.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, Refusal> {
        let Some(given) = self.given.as_deref().filter(|given| !given.is_empty()) else {
            return Err(Refusal::error(format!(
                "fmuResourceLocation is NULL or empty; expected the location of the folder that has {name}"
            )));
        };
        let mut paths = self.places.iter().map(|place| place.join(name));
        let Some((path, size)) = paths
            .find_map(|path| Some((path.metadata().ok()?.len(), path)))
            .map(|(n, p)| (p, n))
        else {
            return Err(Refusal::error(format!(
                "fmuResourceLocation is \"{given}\", and there is no {name}; expected the location of the folder that has it"
            )));
        };
        if size > LARGEST_RESOURCE {
            return Err(Refusal::error(format!(
                "{} has {size} bytes; allowed are at most {LARGEST_RESOURCE}",
                path.display()
            )));
        }
        std::fs::read(&path).map_err(|error| Refusal::error(format!("{} cannot be read: {error}", path.display())))
    }
}

/// The path of a location, still encoded.
fn path_of(location: &str) -> String {
    let is_address = location
        .get(..5)
        .is_some_and(|scheme| scheme.eq_ignore_ascii_case("file:"));
    if !is_address {
        return location.to_owned();
    }
    let rest = &location[5..];
    let path = match rest.strip_prefix("//") {
        // `file:/path`.
        None => rest,
        // `file://host/path`: this machine, a drive that lacks its slash, or another machine.
        Some(rest) => {
            let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
            match host {
                "" | "localhost" => path,
                drive if drive.ends_with(':') => rest,
                _ => return format!("//{rest}"),
            }
        }
    };
    // `/C:/path` on Windows.
    let drive = path.as_bytes();
    if let [b'/', letter, b':' | b'|', ..] = drive
        && letter.is_ascii_alphabetic()
    {
        return format!("{}:{}", char::from(*letter), &path[3..]);
    }
    path.to_owned()
}

/// The text with its `%XX` as the bytes that they stand for; `None` where these are not UTF-8.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let digit = |n: usize| char::from(*after.get(n)?).to_digit(16);
        if let (b'%', Some(high), Some(low)) = (byte, digit(0), digit(1)) {
            bytes.push((16 * high + low) as u8);
            rest = &after[2..];
        } else {
            bytes.push(byte);
            rest = after;
        }
    }
    String::from_utf8(bytes).ok()
}

/// An identifier for a model that resources determine, as a GUID: the 128-bit Fowler–Noll–Vo hash (variant 1a) of the GUID of the
/// library's own model and of the resources. A change of a single byte changes it.
pub fn guid_of(own: &str, resources: &[u8]) -> String {
    let bytes = own.as_bytes().iter().chain(resources);
    let hash = bytes.fold(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d_u128, |hash, &byte| {
        (hash ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b)
    });
    let digits = format!("{hash:032x}");
    let [a, b, c, d, e] = [0..8, 8..12, 12..16, 16..20, 20..32].map(|range| &digits[range]);
    format!("{a}-{b}-{c}-{d}-{e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_found_in_every_notation_of_its_folder() {
        let unique = format!("fmi2 component {} größe%41", std::process::id());
        let fmu = std::env::temp_dir().join(unique);
        let folder = fmu.join("resources");
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("file"), "content").unwrap();
        let plain = folder.to_str().unwrap().replace('\\', "/");
        let plain = plain.trim_start_matches('/');
        let encoded = plain.replace('%', "%25").replace(' ', "%20").replace('ö', "%C3%B6");
        let half = encoded.replace("%C3%B6", "ö").replace('ß', "%c3%9f");
        for location in [
            folder.to_str().unwrap().to_owned(),
            fmu.to_str().unwrap().to_owned(),
            format!("{}/", folder.display()),
            format!("file:///{encoded}"),
            format!("file:////{encoded}"),
            format!("file:/{encoded}"),
            format!("FILE:///{half}/"),
            format!("file://localhost/{encoded}"),
            format!("file:///{plain}"),
        ] {
            let read = Resources::at(Some(&location)).read("file");
            assert_eq!(read.as_deref(), Ok(&b"content"[..]), "{location}");
        }
        std::fs::remove_dir_all(fmu).unwrap();
        for (location, part) in [
            (None, "NULL"),
            (Some(""), "NULL"),
            (Some("file:///nowhere"), "nowhere"),
            (Some("file:"), "no file"),
            (Some("%"), "no file"),
            (Some("file://%%%/é%C3"), "no file"),
        ] {
            let refusal = Resources::at(location).read("file").unwrap_err();
            assert!(refusal.message().contains(part), "{refusal:?}");
        }
    }

    #[test]
    fn addresses_of_drives_and_of_other_machines_are_read() {
        for (location, path) in [
            ("file:///C:/a%20b", "C:/a%20b"),
            ("file://C:/a", "C:/a"),
            ("file:///c|/a", "c:/a"),
            ("file://server/share/a", "//server/share/a"),
            ("file:////server/share/a", "//server/share/a"),
            (r"C:\a", r"C:\a"),
        ] {
            assert_eq!(path_of(location), path);
        }
    }

    #[test]
    fn an_identifier_has_the_form_of_a_guid_and_depends_on_every_byte() {
        let guid = guid_of("own", b"content");
        assert_eq!(guid.split('-').map(str::len).collect::<Vec<_>>(), [8, 4, 4, 4, 12]);
        for (own, content) in [("owm", "content"), ("own", "contenu"), ("own", "content "), ("own", "")] {
            assert_ne!(guid_of(own, content.as_bytes()), guid);
        }
    }
}
