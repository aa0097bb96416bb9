//! Packing: a description and shared libraries become an FMU; two FMUs and a scene become a coupled system.

mod documentation;
mod system;

use std::collections::BTreeMap;
use std::env::consts::{ARCH, DLL_PREFIX, DLL_SUFFIX, OS};
use std::io::{self, Cursor, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use chrono::{DateTime, SecondsFormat};
use fmi2_description::Description;
use vines_model::ArgumentError;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use crate::{files, scene::Scene};

/// One FMU to be.
#[derive(Debug, Clone)]
pub struct Component {
    /// `modelIdentifier`: the name of the FMU and of the library inside it.
    pub identifier: &'static str,
    /// Cargo's package, by which the library is named as well.
    pub package: &'static str,
    /// `modelDescription.xml`, complete but for the date.
    pub xml: String,
    /// Figure of the model as SVG and as PNG, and what the description cannot say as HTML.
    pub svg: &'static str,
    #[expect(missing_docs, reason = "see svg")]
    pub png: &'static [u8],
    #[expect(missing_docs, reason = "see svg")]
    pub text: &'static str,
}

/// The plant and the controller.
pub fn components() -> [Component; 2] {
    // The GUID is that of the library.
    let describe = |xml| fmi2_component_build::describe(xml).expect("build.rs of the component has accepted this text");
    [
        Component {
            identifier: "LoViNes",
            package: "lovines-fmu",
            xml: describe(include_str!("../../modelDescription.xml")),
            svg: include_str!("pack/pictures/LoViNes.svg"),
            png: include_bytes!("pack/pictures/LoViNes.png"),
            text: include_str!("pack/pictures/LoViNes.html"),
        },
        Component {
            identifier: "PhaseLock",
            package: "phase-lock-fmu",
            xml: describe(include_str!("../../controller/fmu/modelDescription.xml")),
            svg: include_str!("pack/pictures/PhaseLock.svg"),
            png: include_bytes!("pack/pictures/PhaseLock.png"),
            text: include_str!("pack/pictures/PhaseLock.html"),
        },
    ]
}

/// Folders below `binaries/`. FMI 2.0 names none for ARM except `darwin64`: the others are those of FMI 3.0.
const FOLDERS: &str = "linux64, linux32, aarch64-linux, win64, win32, aarch64-windows, darwin64, aarch64-darwin";

/// The folders for this machine. On Apple silicon, masters look into either.
fn own_folders() -> &'static [&'static str] {
    match (OS, ARCH) {
        ("windows", "x86") => &["win32"],
        ("windows", "aarch64") => &["aarch64-windows"],
        ("windows", _) => &["win64"],
        ("macos", "aarch64") => &["aarch64-darwin", "darwin64"],
        ("macos", _) => &["darwin64"],
        (_, "x86") => &["linux32"],
        (_, "aarch64") => &["aarch64-linux"],
        _ => &["linux64"],
    }
}

/// A library for the platform of a folder below `binaries/`; parse it from `win64=PATH`.
#[derive(Debug, Clone)]
pub struct Binary {
    folder: String,
    path: PathBuf,
}

impl FromStr for Binary {
    type Err = ArgumentError;

    fn from_str(argument: &str) -> Result<Self, ArgumentError> {
        let (folder, path) = argument
            .split_once('=')
            .ok_or("expected PLATFORM=PATH, for instance win64=lovines_fmu.dll")?;
        if !FOLDERS.split(", ").any(|known| known == folder) {
            return Err(format!("`{folder}` is not a platform; known are {FOLDERS}").into());
        }
        Ok(Self { folder: folder.into(), path: path.into() })
    }
}

/// Where the libraries come from.
#[derive(Debug, Clone)]
pub struct Libraries {
    /// Folder with those for this machine, under the names that cargo gives them.
    pub folder: PathBuf,
    /// Whether those for this machine are packed at all.
    pub own: bool,
    /// Those given with their platforms; one for this machine takes the place of that in the folder.
    pub others: Vec<Binary>,
}

impl From<&Path> for Libraries {
    fn from(folder: &Path) -> Self {
        Self { folder: folder.into(), own: true, others: Vec::new() }
    }
}

/// A failure that names the file and what to do.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum PackError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{} {problem}", path.display())]
    Library { path: PathBuf, problem: String },
    #[error(
        "there is no library of {0} for any platform: give one by --binary PLATFORM=FILE, or leave out --only-binaries"
    )]
    Unserved(&'static str),
    #[error("SOURCE_DATE_EPOCH = {0:?} is refused; allowed are seconds since 1970, for instance 1700000000")]
    Date(String),
    #[error("the scene's controller: {0}")]
    Controller(#[from] phase_lock::ConfigError),
    #[error("the description cannot be read: {0}")]
    Description(#[from] fmi2_description::Error),
    #[error(transparent)]
    Write(#[from] files::FileError),
}

/// Name and content of a file.
type File = (String, Vec<u8>);

/// Packs the components into `out`, one `<identifier>.fmu` each, and returns their paths.
///
/// Nothing is written unless all of them can be; a file is complete or absent.
pub fn pack(components: &[Component], libraries: &Libraries, out: &Path) -> Result<Vec<PathBuf>, PackError> {
    Ok(files::write(out, fmus(components, libraries)?)?)
}

/// Packs plant and controller into `out`, and the two of them coupled as `bench.ssp` with the parameters of the scene.
pub fn pack_bench(scene: &Scene, libraries: &Libraries, out: &Path) -> Result<Vec<PathBuf>, PackError> {
    let mut files = fmus(&components(), libraries)?;
    files.push(system::file(scene, &files, date()?)?);
    Ok(files::write(out, files)?)
}

fn fmus(components: &[Component], libraries: &Libraries) -> Result<Vec<File>, PackError> {
    let date = date()?.map_or(String::new(), |date| format!(" generationDateAndTime=\"{date}\""));
    let descriptions = components.iter().map(|one| Description::parse(&one.xml));
    let descriptions = descriptions.collect::<Result<Vec<_>, _>>()?;
    let guids: Vec<&str> = descriptions.iter().map(|one| one.guid.as_str()).collect();
    let binaries = binaries(components, &guids, libraries)?;
    let fmus = components.iter().zip(&descriptions).enumerate();
    let fmus = fmus.map(|(n, (component, description))| {
        let identifier = component.identifier;
        let xml = component.xml.replacen(" guid=", &format!("{date} guid="), 1);
        let mut entries = vec![
            ("modelDescription.xml".to_owned(), xml.into_bytes()),
            (
                "documentation/index.html".to_owned(),
                documentation::page(component, description).into_bytes(),
            ),
            ("model.png".to_owned(), component.png.to_vec()),
        ];
        let others = entries.len();
        for ((_, folder), content) in binaries.iter().filter(|((index, _), _)| *index == n) {
            let suffix = match folder {
                _ if folder.contains("darwin") => ".dylib",
                _ if folder.contains("win") => ".dll",
                _ => ".so",
            };
            entries.push((format!("binaries/{folder}/{identifier}{suffix}"), content.clone()));
        }
        match entries.len() == others {
            true => Err(PackError::Unserved(identifier)),
            false => archive(format!("{identifier}.fmu"), &entries),
        }
    });
    fmus.collect()
}

/// The date of the sources by the convention of reproducible builds. No clock is read: the same input gives the same
/// bytes.
fn date() -> Result<Option<String>, PackError> {
    let seconds = std::env::var_os("SOURCE_DATE_EPOCH").unwrap_or_default();
    match seconds.is_empty() {
        true => Ok(None),
        false => format_date(&seconds.to_string_lossy()).map(Some),
    }
}

/// Seconds since 1970 in the format of XML.
fn format_date(seconds: &str) -> Result<String, PackError> {
    let date = seconds
        .parse()
        .ok()
        .and_then(|seconds| DateTime::from_timestamp(seconds, 0));
    let date = date.ok_or_else(|| PackError::Date(seconds.to_owned()))?;
    Ok(date.to_rfc3339_opts(SecondsFormat::Secs, true))
}

/// The libraries, by the index of their component and the folder of their platform.
fn binaries<'a>(
    components: &[Component],
    guids: &[&str],
    libraries: &'a Libraries,
) -> Result<BTreeMap<(usize, &'a str), Vec<u8>>, PackError> {
    let mut binaries = BTreeMap::new();
    let refused = |path: &Path, problem| PackError::Library { path: path.into(), problem };
    for Binary { folder, path } in &libraries.others {
        let content = read(path)?;
        // The GUID in a library determines its component.
        let Some(n) = guids.iter().position(|guid| mentions(&content, guid)) else {
            let names: Vec<_> = components.iter().map(|one| one.identifier).collect();
            let problem = format!(
                "belongs to none of {}: it contains the GUID of none of them, because it was built from other variables; build it again",
                names.join(", ")
            );
            return Err(refused(path, problem));
        };
        if binaries.insert((n, folder.as_str()), content).is_some() {
            let problem = format!("would be the second {folder} library of {}", components[n].identifier);
            return Err(refused(path, problem));
        }
    }
    for (n, Component { identifier, package, .. }) in components.iter().enumerate().filter(|_| libraries.own) {
        let path = format!("{DLL_PREFIX}{}{DLL_SUFFIX}", package.replace('-', "_"));
        let path = libraries.folder.join(path);
        let refused = |reason| {
            let problem = format!(
                "is not the library of {identifier} for this machine: {reason}; build it with `cargo build --release -p {package}`, \
                 or name its folder with --libraries"
            );
            refused(&path, problem)
        };
        vines_fmu::check(&path).map_err(refused)?;
        let content = read(&path)?;
        if !mentions(&content, guids[n]) {
            return Err(refused(format!(
                "it was built from other variables than {identifier} has now"
            )));
        }
        for folder in own_folders() {
            binaries.entry((n, *folder)).or_insert_with(|| content.clone());
        }
    }
    Ok(binaries)
}

fn read(path: &Path) -> Result<Vec<u8>, PackError> {
    std::fs::read(path).map_err(|source| PackError::Read { path: path.into(), source })
}

/// Whether `text` stands anywhere in the library.
fn mentions(file: &[u8], text: &str) -> bool {
    !text.is_empty() && file.windows(text.len()).any(|part| part == text.as_bytes())
}

/// The zip archive of these files, as a file. The same content gives the same bytes.
fn archive(name: String, entries: &[File]) -> Result<File, PackError> {
    let zip = || -> io::Result<Vec<u8>> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, content) in entries {
            let method = match name.ends_with(".fmu") {
                true => CompressionMethod::Stored,
                false => CompressionMethod::Deflated,
            };
            let options = SimpleFileOptions::DEFAULT
                .compression_method(method)
                .unix_permissions(0o644);
            zip.start_file(name, options)?;
            zip.write_all(content)?;
        }
        Ok(zip.finish()?.into_inner())
    };
    match zip() {
        Ok(content) => Ok((name, content)),
        Err(source) => Err(files::FileError { path: name.into(), source }.into()),
    }
}

#[cfg(test)]
#[path = "../tests/unit/pack.rs"]
mod tests;
