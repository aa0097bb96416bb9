//! Packing: a description and shared libraries become an FMU, a zip archive; two FMUs and a scene become a coupled system in the format of
//! SSP 1.0, System Structure and Parameterization. The same input gives the same bytes.

mod lock;
mod structure;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::io::{self, Cursor, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use fmi2_description::Description;
use maud::{DOCTYPE, PreEscaped, html};
use phase_lock::{Config, PARAMETERS, Value};
use vines_fmu::{PLATFORMS, own_platforms};
use vines_model::ArgumentError;
use zip::{ZipWriter, result::ZipError, write::SimpleFileOptions};

use crate::{scene::Scene, table::Table};

/// What an FMU is packed from.
#[derive(Debug, Clone)]
pub struct Component {
    /// `modelIdentifier`: the name of the FMU and of the library inside it.
    pub identifier: &'static str,
    /// Cargo's package, by which the library is named as well.
    pub package: &'static str,
    /// `modelDescription.xml`.
    pub xml: String,
    /// The GUID in its library: that of the description, unless the library serves several models.
    pub library_guid: String,
    /// Figure of the model.
    pub png: &'static [u8],
    /// The figure again as SVG, and what the description cannot say, as HTML.
    pub page: Cow<'static, str>,
    /// Other files, by their paths in the FMU.
    pub files: Vec<File>,
}

macro_rules! component {
    ($identifier:literal, $package:literal, $xml:expr, $files:expr) => {
        Component {
            identifier: $identifier,
            package: $package,
            // With the GUID of the library.
            xml: fmi2_component_build::describe($xml).expect("build.rs of the component has accepted this text"),
            library_guid: fmi2_component_build::guid_of($xml)
                .expect("build.rs of the component has accepted this text"),
            png: include_bytes!(concat!("pack/pictures/", $identifier, ".png")),
            page: Cow::Borrowed(concat!(
                include_str!(concat!("pack/pictures/", $identifier, ".svg")),
                include_str!(concat!("pack/pictures/", $identifier, ".html"))
            )),
            files: $files,
        }
    };
}

/// The plant and the controller.
pub fn components() -> [Component; 2] {
    let [plant, controller] = lock::resources();
    [
        component!("LoViNes", "lovines-fmu", lovines::MODEL_DESCRIPTION, plant),
        component!("PhaseLock", "phase-lock-fmu", phase_lock::MODEL_DESCRIPTION, controller),
    ]
}

/// The plant of a scene and the controller.
pub fn components_of(scene: &Scene) -> Result<[Component; 2], PackError> {
    let [oscillator, controller] = components();
    let plant = match &scene.structure {
        Some(host) => structure::component(&oscillator, host, scene)?,
        None => oscillator,
    };
    Ok([plant, controller])
}

/// A library for a platform; parse it from `win64=PATH`.
#[derive(Debug, Clone)]
pub struct Binary {
    /// Folder below `binaries/`, and suffix of the library in it.
    platform: [&'static str; 2],
    path: PathBuf,
}

impl FromStr for Binary {
    type Err = ArgumentError;

    fn from_str(argument: &str) -> Result<Self, ArgumentError> {
        let (name, path) = argument
            .split_once('=')
            .ok_or("expected PLATFORM=PATH, for instance win64=lovines_fmu.dll")?;
        let Some((folder, .., suffix)) = PLATFORMS.into_iter().find(|platform| platform.0 == name) else {
            let folders = PLATFORMS.map(|(folder, ..)| folder).join(", ");
            return Err(format!("`{name}` is not a platform; known are {folders}").into());
        };
        Ok(Self { platform: [folder, suffix], path: path.into() })
    }
}

/// The libraries of components for this machine, in a folder, under the names that cargo gives them.
pub fn own_libraries(components: &[Component], folder: &Path) -> Result<Vec<Binary>, PackError> {
    let mut binaries = Vec::new();
    for Component { identifier, package, .. } in components {
        let path = folder.join(format!("{DLL_PREFIX}{}{DLL_SUFFIX}", package.replace('-', "_")));
        vines_fmu::check(&path).map_err(|reason| PackError::NotOwn {
            path: path.clone(),
            identifier,
            package,
            reason,
        })?;
        binaries
            .extend(own_platforms().map(|(folder, suffix)| Binary { platform: [folder, suffix], path: path.clone() }));
    }
    Ok(binaries)
}

/// A failure that names the file.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum PackError {
    #[error("{} is not the library of {identifier} for this machine: {reason}", path.display())]
    NotOwn {
        path: PathBuf,
        identifier: &'static str,
        package: &'static str,
        reason: String,
    },
    #[error("{0} has no library")]
    NoLibrary(String),
    #[error("{} cannot be read: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{} contains the GUID of no FMU of this program: it was built from other variables", .0.display())]
    Foreign(PathBuf),
    #[error("the description cannot be read: {0}")]
    Description(#[from] fmi2_description::Error),
    #[error(transparent)]
    Refused(#[from] lovines::Refused),
    #[error(transparent)]
    Archive(#[from] ZipError),
}

/// Name and content of a file.
pub type File = (String, Vec<u8>);

/// Plant and controller of a scene, and for an oscillator the two of them coupled as `bench.ssp` with the parameters of the scene.
pub fn pack_bench(scene: &Scene, binaries: &[Binary]) -> Result<Vec<File>, PackError> {
    let mut files = pack(&components_of(scene)?, binaries)?;
    if scene.structure.is_none() {
        files.push(system(scene, &files)?);
    }
    Ok(files)
}

/// The FMUs of components, one `<identifier>.fmu` each. Of two libraries of a component for a platform, the later counts.
pub fn pack(components: &[Component], binaries: &[Binary]) -> Result<Vec<File>, PackError> {
    let descriptions = components.iter().map(|component| Description::parse(&component.xml));
    let descriptions = descriptions.collect::<Result<Vec<_>, _>>()?;
    // Name and content of the libraries of each component; the GUID in a library determines its component.
    let mut libraries = vec![BTreeMap::new(); components.len()];
    for Binary { platform: [folder, suffix], path } in binaries {
        let content = std::fs::read(path).map_err(|source| PackError::Unreadable { path: path.clone(), source })?;
        let contains = |text: &str| content.windows(text.len()).any(|part| part == text.as_bytes());
        let owner = components
            .iter()
            .position(|component| contains(&component.library_guid));
        let owner = owner.ok_or_else(|| PackError::Foreign(path.clone()))?;
        let name = format!("binaries/{folder}/{}{suffix}", components[owner].identifier);
        libraries[owner].insert(name, content);
    }
    let mut fmus = Vec::new();
    for ((component, description), libraries) in components.iter().zip(&descriptions).zip(libraries) {
        let name = format!("{}.fmu", component.identifier);
        if libraries.is_empty() {
            return Err(PackError::NoLibrary(name));
        }
        let entries = [
            ("modelDescription.xml", component.xml.clone().into_bytes()),
            (
                "documentation/index.html",
                documentation(component, description).into_bytes(),
            ),
            ("model.png", component.png.to_vec()),
        ];
        let entries = entries.map(|(name, content)| (name.into(), content));
        let entries = entries.into_iter().filter(|(_, content)| !content.is_empty());
        let files = component.files.iter().cloned();
        fmus.push(archive(name, entries.chain(files).chain(libraries))?);
    }
    Ok(fmus)
}

/// The zip archive of these files, as a file.
fn archive(name: String, entries: impl IntoIterator<Item = File>) -> Result<File, PackError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        zip.start_file(name, SimpleFileOptions::DEFAULT.unix_permissions(0o644))?;
        zip.write_all(&content).map_err(ZipError::from)?;
    }
    Ok((name, zip.finish()?.into_inner()))
}

/// The page inside an FMU: its table comes from `modelDescription.xml`, figure, equations and explanations from `pictures/`.
fn documentation(component: &Component, description: &Description) -> String {
    let rows = description.variables.iter().map(|variable| {
        let content = variable
            .content()
            .map(|(_, content)| content.clone())
            .unwrap_or_default();
        let kind = format!("{:?}, {:?}", variable.causality, variable.variability);
        let (start, unit) = (content.start.unwrap_or_default(), content.unit.unwrap_or_default());
        [variable.name.clone(), start, unit, kind, variable.description.clone()]
    });
    let variables = Table::new("name | start | unit | causality, variability | meaning").rows(rows);
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
                p { (description.description) ". Version " (description.version) "; FMI " (description.fmi_version) "." }
                (PreEscaped(&component.page)) (variables.html("Variables"))
            }
        }
    };
    page.into_string()
}

/// Outputs of the plant whose start is a parameter, too, under another name.
const START_PARAMETERS: [(&str, &str); 4] = [
    ("q1", "q1_start"),
    ("der(q1)", "der_q1_start"),
    ("q2", "q2_start"),
    ("der(q2)", "der_q2_start"),
];

/// The structure of the coupled system; step size and end of the default experiment are filled in.
const SYSTEM_STRUCTURE: &str = include_str!("pack/SystemStructure.ssd");

/// The end of the default experiment, natural periods: the default scene has been locked for nearly a hundred by then.
const OSCILLATOR_PERIODS: f64 = 400.0;

/// The system file of the FMUs, with the parameters of the scene.
fn system(scene: &Scene, fmus: &[File]) -> Result<File, PackError> {
    // The communication step is the controller's.
    let step = scene.sample_time();
    let stop = OSCILLATOR_PERIODS * scene.dimensionless().natural_period();
    let mut structure = SYSTEM_STRUCTURE.to_owned();
    for (attribute, value) in [("stopTime", stop), ("stepSize", step), ("baseStepSize", step)] {
        let [derived, own] = ["derived".into(), value.to_string()].map(|value| format!(" {attribute}=\"{value}\""));
        structure = structure.replace(&derived, &own);
    }
    let entries = [
        ("SystemStructure.ssd".to_owned(), structure.into_bytes()),
        (
            "resources/plant.ssv".to_owned(),
            parameter_set("plant", plant_values(scene)),
        ),
        (
            "resources/controller.ssv".to_owned(),
            parameter_set("controller", controller_values(&scene.plan().lock)),
        ),
    ];
    let fmus = fmus
        .iter()
        .map(|(name, content)| (format!("resources/{name}"), content.clone()));
    archive("bench.ssp".into(), entries.into_iter().chain(fmus))
}

/// Parameters and start of the plant. The start goes by its parameters: some masters set no start value of an output.
fn plant_values(scene: &Scene) -> impl Iterator<Item = (&'static str, Value)> {
    scene.start_values().into_iter().map(|(name, value)| {
        let parameter = START_PARAMETERS.iter().find(|(output, _)| *output == name);
        (parameter.map_or(name, |(_, parameter)| parameter), value)
    })
}

/// Settings of the controller, which is armed from the start.
fn controller_values(config: &Config) -> impl Iterator<Item = (&'static str, Value)> {
    let settings = PARAMETERS
        .iter()
        .map(move |parameter| (parameter.name, parameter.get(config)));
    settings.chain([("active", Value::Boolean(true))])
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
