//! Packing: a description and shared libraries become an FMU, a zip archive; two FMUs and a scene become a coupled system in the format of
//! SSP 1.0, System Structure and Parameterization.

use std::collections::BTreeMap;
use std::env::consts::{ARCH, DLL_PREFIX, DLL_SUFFIX, OS};
use std::io::{self, Cursor, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use chrono::{DateTime, SecondsFormat};
use fmi2_description::{Causality, Description};
use maud::{DOCTYPE, PreEscaped, html};
use phase_lock::{PARAMETERS, Value};
use vines_model::ArgumentError;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use crate::{files, report::Table, scene::Scene};

/// What an FMU is packed from.
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

macro_rules! component {
    ($identifier:literal, $package:literal, $xml:literal) => {
        Component {
            identifier: $identifier,
            package: $package,
            // With the GUID of the library.
            xml: fmi2_component_build::describe(include_str!($xml))
                .expect("build.rs of the component has accepted this text"),
            svg: include_str!(concat!("pack/pictures/", $identifier, ".svg")),
            png: include_bytes!(concat!("pack/pictures/", $identifier, ".png")),
            text: include_str!(concat!("pack/pictures/", $identifier, ".html")),
        }
    };
}

/// The plant and the controller.
pub fn components() -> [Component; 2] {
    [
        component!("LoViNes", "lovines-fmu", "../../modelDescription.xml"),
        component!(
            "PhaseLock",
            "phase-lock-fmu",
            "../../controller/fmu/modelDescription.xml"
        ),
    ]
}

/// Folders below `binaries/`, with their system, processor and suffix of a library. FMI 2.0 names none for ARM except `darwin64`; the names
/// for ARM are from FMI 3.0.
const PLATFORMS: [(&str, &str, &str, &str); 8] = [
    ("linux64", "linux", "x86_64", ".so"),
    ("linux32", "linux", "x86", ".so"),
    ("aarch64-linux", "linux", "aarch64", ".so"),
    ("win64", "windows", "x86_64", ".dll"),
    ("win32", "windows", "x86", ".dll"),
    ("aarch64-windows", "windows", "aarch64", ".dll"),
    ("darwin64", "macos", "x86_64", ".dylib"),
    ("aarch64-darwin", "macos", "aarch64", ".dylib"),
];

/// The folders for this machine. On Apple silicon, masters look into either.
fn own_folders() -> impl Iterator<Item = &'static str> {
    let own = PLATFORMS.into_iter().filter(|(_, os, arch, _)| {
        let either = OS == "macos" && ARCH == "aarch64";
        *os == OS && (*arch == ARCH || either)
    });
    own.map(|(folder, ..)| folder)
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
        let folders = PLATFORMS.map(|(folder, ..)| folder);
        match folders.contains(&folder) {
            true => Ok(Self { folder: folder.into(), path: path.into() }),
            false => Err(format!("`{folder}` is not a platform; known are {}", folders.join(", ")).into()),
        }
    }
}

/// Where the libraries come from.
#[derive(Debug, Clone)]
pub struct Libraries {
    /// Folder with the libraries for this machine, under the names that cargo gives them; `None`: they are not packed.
    pub folder: Option<PathBuf>,
    /// Libraries given with their platforms; one for this machine replaces the library in the folder.
    pub others: Vec<Binary>,
}

impl From<&Path> for Libraries {
    fn from(folder: &Path) -> Self {
        Self { folder: Some(folder.into()), others: Vec::new() }
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
    files.push(system(scene, &files, date()?)?);
    Ok(files::write(out, files)?)
}

fn fmus(components: &[Component], libraries: &Libraries) -> Result<Vec<File>, PackError> {
    let date = date()?.map_or(String::new(), |date| format!(" generationDateAndTime=\"{date}\""));
    let descriptions = components.iter().map(|component| Description::parse(&component.xml));
    let descriptions = descriptions.collect::<Result<Vec<_>, _>>()?;
    // Folder and content of the libraries of each component; the GUID in a library determines its component.
    let mut binaries = vec![BTreeMap::new(); components.len()];
    for Binary { folder, path } in &libraries.others {
        let refused = |problem| PackError::Library { path: path.clone(), problem };
        let content = read(path)?;
        let owner = descriptions
            .iter()
            .position(|description| mentions(&content, &description.guid));
        let names: Vec<_> = components.iter().map(|component| component.identifier).collect();
        let owner = owner.ok_or_else(|| {
            refused(format!(
                "belongs to none of {}: it contains the GUID of none of them, because it was built from other variables; build it again",
                names.join(", ")
            ))
        })?;
        if binaries[owner].insert(folder.as_str(), content).is_some() {
            return Err(refused(format!(
                "would be the second {folder} library of {}",
                names[owner]
            )));
        }
    }
    let mut files = Vec::new();
    for ((component, description), mut binaries) in components.iter().zip(&descriptions).zip(binaries) {
        let identifier = component.identifier;
        if let Some(folder) = &libraries.folder {
            let content = own_library(component, &description.guid, folder)?;
            for folder in own_folders() {
                binaries.entry(folder).or_insert_with(|| content.clone());
            }
        }
        if binaries.is_empty() {
            return Err(PackError::Unserved(identifier));
        }
        let xml = component.xml.replacen(" guid=", &format!("{date} guid="), 1);
        let mut entries = vec![
            ("modelDescription.xml".to_owned(), xml.into_bytes()),
            (
                "documentation/index.html".to_owned(),
                documentation(component, description).into_bytes(),
            ),
            ("model.png".to_owned(), component.png.to_vec()),
        ];
        entries.extend(binaries.into_iter().map(|(folder, content)| {
            let platform = PLATFORMS.iter().find(|platform| platform.0 == folder);
            let suffix = platform.map_or("", |platform| platform.3);
            (format!("binaries/{folder}/{identifier}{suffix}"), content)
        }));
        files.push(archive(format!("{identifier}.fmu"), &entries)?);
    }
    Ok(files)
}

/// The library of a component for this machine.
fn own_library(component: &Component, guid: &str, folder: &Path) -> Result<Vec<u8>, PackError> {
    let Component { identifier, package, .. } = component;
    let path = folder.join(format!("{DLL_PREFIX}{}{DLL_SUFFIX}", package.replace('-', "_")));
    let refused = |reason: &str| PackError::Library {
        path: path.clone(),
        problem: format!(
            "is not the library of {identifier} for this machine: {reason}; build it with `cargo build --release -p {package}`, \
             or name its folder with --libraries"
        ),
    };
    vines_fmu::check(&path).map_err(|reason| refused(&reason))?;
    let content = read(&path)?;
    match mentions(&content, guid) {
        true => Ok(content),
        false => Err(refused(&format!(
            "it was built from other variables than {identifier} has now"
        ))),
    }
}

/// The date of the sources by the convention of reproducible builds, in the format of XML. No clock is read: the same input gives the same
/// bytes.
fn date() -> Result<Option<String>, PackError> {
    let seconds = std::env::var("SOURCE_DATE_EPOCH").unwrap_or_default();
    (!seconds.is_empty()).then(|| format_date(&seconds)).transpose()
}

fn format_date(seconds: &str) -> Result<String, PackError> {
    let date = seconds
        .parse()
        .ok()
        .and_then(|seconds| DateTime::from_timestamp(seconds, 0));
    let date = date.ok_or_else(|| PackError::Date(seconds.to_owned()))?;
    Ok(date.to_rfc3339_opts(SecondsFormat::Secs, true))
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
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let written = entries.iter().try_for_each(|(name, content)| {
        let method = match name.ends_with(".fmu") {
            true => CompressionMethod::Stored,
            false => CompressionMethod::Deflated,
        };
        let options = SimpleFileOptions::DEFAULT
            .compression_method(method)
            .unix_permissions(0o644);
        zip.start_file(name, options)?;
        zip.write_all(content)
    });
    match written.and_then(|()| Ok(zip.finish()?.into_inner())) {
        Ok(content) => Ok((name, content)),
        Err(source) => Err(files::FileError { path: name.into(), source }.into()),
    }
}

/// The page inside an FMU: its tables come from `modelDescription.xml`, figure, equations and explanations from `pictures/`.
fn documentation(component: &Component, description: &Description) -> String {
    let interfaces = [
        description.co_simulation.as_ref().map(|_| "co-simulation"),
        description.model_exchange.as_ref().map(|_| "model exchange"),
    ];
    let interfaces: Vec<_> = interfaces.into_iter().flatten().collect();
    let experiment = &description.default_experiment;
    let [start, stop, step] = [&experiment.start_time, &experiment.stop_time, &experiment.step_size]
        .map(|time| time.as_deref().map_or("?".into(), rounded));
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { (description.model_name) }
                style { (PreEscaped(include_str!("pack/pictures/style.css"))) }
            }
            body {
                h1 { (description.model_name) }
                p { (description.description) "." }
                (PreEscaped(component.svg)) (PreEscaped(component.text))
                p {
                    "Version " (description.version) "; FMI " (description.fmi_version) "; " (interfaces.join(" and "))
                    ". Default experiment: " (start) " s to " (stop) " s in steps of " (step) " s."
                }
                @for (causality, heading) in SECTIONS {
                    @let table = table(description, causality);
                    @if !table.is_empty() { (table.html(heading)) }
                }
            }
        }
    };
    page.into_string()
}

/// Causalities in the order of the page.
const SECTIONS: [(Causality, &str); 5] = [
    (Causality::Parameter, "Parameters"),
    (Causality::CalculatedParameter, "Calculated parameters"),
    (Causality::Input, "Inputs"),
    (Causality::Output, "Outputs"),
    (Causality::Local, "Local variables"),
];

/// A number with at most six digits. The description has all digits.
fn rounded(text: &str) -> String {
    let Some(number) = text.parse::<f64>().ok().filter(|_| text.len() > 8) else {
        return text.to_owned();
    };
    let six: f64 = format!("{number:.5e}").parse().unwrap_or(number);
    match (1e-3..1e6).contains(&six.abs()) {
        true => format!("{six}"),
        false => format!("{six:e}"),
    }
}

/// The variables of one causality.
fn table(description: &Description, causality: Causality) -> Table {
    let variables = description.variables.iter();
    let rows = variables
        .filter(|variable| variable.causality == causality)
        .map(|variable| {
            let content = variable
                .content()
                .map(|(_, content)| content.clone())
                .unwrap_or_default();
            vec![
                variable.name.clone(),
                rounded(&content.start.unwrap_or_default()),
                content.unit.unwrap_or_default(),
                format!("{:?}", variable.variability).to_lowercase(),
                variable.description.clone(),
            ]
        });
    Table::new("name | start | unit | variability | meaning").rows(rows)
}

/// The structure of the coupled system; step size and end of the default experiment, and the date, are filled in.
const STRUCTURE: &str = include_str!("pack/SystemStructure.ssd");

/// The end of the default experiment, natural periods: the default scene has been locked for nearly a hundred by then.
const PERIODS: f64 = 400.0;

/// The system file of the FMUs, with the parameters of the scene and the date of generation.
fn system(scene: &Scene, fmus: &[File], date: Option<String>) -> Result<File, PackError> {
    // The communication step is the controller's.
    let step = scene.sample_time().to_string();
    let stop = PERIODS * scene.dimensionless().natural_period();
    let mut structure = STRUCTURE.to_owned();
    for (attribute, value) in [
        ("stopTime", Some(stop.to_string())),
        ("stepSize", Some(step.clone())),
        ("baseStepSize", Some(step)),
        ("generationDateAndTime", date),
    ] {
        let filled = value.map_or(String::new(), |value| format!(" {attribute}=\"{value}\""));
        structure = structure.replace(&format!(" {attribute}=\"derived\""), &filled);
    }
    let mut entries = vec![
        ("SystemStructure.ssd".to_owned(), structure.into_bytes()),
        ("resources/plant.ssv".to_owned(), parameter_set("plant", plant(scene))),
        (
            "resources/controller.ssv".to_owned(),
            parameter_set("controller", controller(scene)?),
        ),
    ];
    entries.extend(
        fmus.iter()
            .map(|(name, content)| (format!("resources/{name}"), content.clone())),
    );
    archive("bench.ssp".into(), &entries)
}

/// Parameters and start of the plant. The start goes by its parameters: some masters set no start value of an output.
fn plant(scene: &Scene) -> impl Iterator<Item = (&str, Value)> {
    scene.start_values().into_iter().map(|(name, value)| {
        let parameter = match name {
            "q1" => "q1_start",
            "der(q1)" => "der_q1_start",
            "q2" => "q2_start",
            "der(q2)" => "der_q2_start",
            name => name,
        };
        (parameter, value)
    })
}

/// Parameters of the controller, which is armed from the start.
fn controller(scene: &Scene) -> Result<impl Iterator<Item = (&str, Value)>, PackError> {
    let config = scene.controller_config();
    config.build()?;
    let parameters = PARAMETERS.iter();
    Ok(parameters
        .map(move |parameter| (parameter.name, parameter.get(&config)))
        .chain([("active", Value::Boolean(true))]))
}

/// A file of parameter values. Every set has its own name, since some masters merge sets of the same name.
fn parameter_set<'a>(name: &str, values: impl Iterator<Item = (&'a str, Value)>) -> Vec<u8> {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssv:ParameterSet version=\"1.0\" name=\"{name}\" \
         generationTool=\"vines\"\n  xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\">\n  \
         <ssv:Parameters>\n",
    );
    for (name, value) in values {
        let value = match value {
            Value::Real(number) => format!("<ssv:Real value=\"{number}\"/>"),
            Value::Integer(number) => format!("<ssv:Integer value=\"{number}\"/>"),
            Value::Boolean(truth) => format!("<ssv:Boolean value=\"{truth}\"/>"),
        };
        text += &format!("    <ssv:Parameter name=\"{name}\">{value}</ssv:Parameter>\n");
    }
    (text + "  </ssv:Parameters>\n</ssv:ParameterSet>\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn what_goes_in_comes_out_again_and_the_same_entries_give_the_same_bytes() {
        let entries = [
            ("a.xml".to_owned(), b"<a/>".to_vec()),
            ("binaries/x/a.so".to_owned(), vec![7; 5000]),
            ("resources/a.fmu".to_owned(), vec![8; 50]),
        ];
        let bytes = || archive("a.ssp".into(), &entries).unwrap().1;
        assert_eq!(bytes(), bytes());
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes())).unwrap();
        for (name, content) in entries {
            let mut read = Vec::new();
            archive.by_name(&name).unwrap().read_to_end(&mut read).unwrap();
            assert_eq!(read, content);
        }
    }

    #[test]
    fn seconds_become_a_date_in_universal_time_and_anything_else_is_refused() {
        assert_eq!(format_date("1700000000").unwrap(), "2023-11-14T22:13:20Z");
        for text in ["yesterday", "1.5", "99999999999999999"] {
            let message = format_date(text).expect_err("no date").to_string();
            assert!(message.contains(text) && message.contains("1700000000"), "{message}");
        }
    }

    #[test]
    fn the_page_has_every_variable_and_the_picture() {
        for component in components() {
            let description = Description::parse(&component.xml).unwrap();
            let page = documentation(&component, &description);
            for variable in description.variables {
                let name = &variable.name;
                assert!(page.contains(&format!("<tr><td>{name}</td>")), "{name}");
                let description = html! { (variable.description) }.into_string();
                assert!(page.contains(&description), "{name}");
            }
            assert!(page.contains("<svg") && component.png.starts_with(b"\x89PNG"));
        }
    }

    /// All but whole numbers, and the parameters of a wall, whose unit depends on the law.
    #[test]
    fn numbers_have_at_most_six_digits() {
        for (exact, shown) in [
            ("0.0011343573395537938", "0.00113436"),
            ("9.246125558182298e-05", "9.24613e-5"),
            ("-1.5707963267948966", "-1.5708"),
            ("11680", "11680"),
            ("1e-6", "1e-6"),
            ("true", "true"),
            ("", ""),
        ] {
            assert_eq!(rounded(exact), shown);
        }
    }
}
