//! The components that this project packs.

/// One FMU to be.
#[derive(Debug, Clone)]
pub struct Component {
    /// `modelIdentifier`: the name of the FMU and of the library inside it.
    pub identifier: &'static str,
    /// Cargo's name of the library, without prefix and suffix.
    pub library: &'static str,
    /// Cargo's package.
    pub package: &'static str,
    /// The finished `modelDescription.xml`.
    pub description: String,
}

impl Component {
    /// The guid in the description, which the library must hold as well.
    pub(super) fn guid(&self) -> Option<&str> {
        let (_, rest) = self.description.split_once("guid=\"")?;
        rest.split('"').next()
    }

    /// The description with the date at which the FMU was made, where there is one.
    pub(super) fn dated(&self, date: Option<&str>) -> String {
        let (Some(date), Some((before, rest))) = (date, self.description.split_once("guid=\"")) else {
            return self.description.clone();
        };
        format!("{before}generationDateAndTime=\"{date}\" guid=\"{rest}")
    }
}

/// The plant and the controller.
pub fn components() -> [Component; 2] {
    [
        Component {
            identifier: "LoViNes",
            library: "lovines_fmu",
            package: "lovines-fmu",
            description: describe(include_str!("../../../modelDescription.xml")),
        },
        Component {
            identifier: "PhaseLock",
            library: "phase_lock_fmu",
            package: "phase-lock-fmu",
            description: describe(include_str!("../../../controller/fmu/modelDescription.xml")),
        },
    ]
}

/// Gives the description the guid that the library was built with.
fn describe(xml: &str) -> String {
    fmi2_component_build::describe(xml).expect("build.rs of the component has accepted this text")
}
