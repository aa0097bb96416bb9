//! An FMI 2.0 shell: it makes an FMU from a Rust struct.
//!
//! A component is exported by three files: its `modelDescription.xml`, a `build.rs` of two lines, and
//! about a hundred lines that connect variables to numbers. This crate does everything else that the standard requires (life
//! cycle, pointers, value references, logging, FMU states).
//!
//! # How to export a component
//!
//! `Cargo.toml` of the component, a crate of its own:
//!
//! ```toml
//! [lib]
//! crate-type = ["cdylib"]
//!
//! [dependencies]
//! fmi2-component = "0.1"
//! serde = { version = "1", features = ["derive"] }   # for serialised FMU states
//!
//! [build-dependencies]
//! fmi2-component-build = "0.1"
//! ```
//!
//! `build.rs` checks the description and turns it into a typed table, so that a name, unit, value reference or start
//! value is written once:
//!
//! ```ignore
//! //! Turns the model description into the variable table.
//!
//! fn main() {
//!     fmi2_component_build::generate("modelDescription.xml");
//! }
//! ```
//!
//! `src/lib.rs` implements [`Component`] for a struct and ends with `fmi2_component::export!(MyComponent)`. The repository has a folder to
//! copy, `fmi2-component/template/`, and a larger example, a water tank, in `fmi2-component/example/`.
//!
//! A component whose equations a master may integrate also implements [`ModelExchange`], and is
//! exported by `fmi2_component::export!(MyComponent, model_exchange)`. Its description lists states and derivatives
//! in `ModelStructure`, once; `exchange.rs` of `lovines-fmu`, the FMU of the plant, is an example.
//!
//! The FMU is a zip of the description, as `fmi2_component_build::describe` completes it, and of the library as
//! `binaries/linux64/<modelIdentifier>.so` (or the platform's equivalent). The program `fmi2-pack` of
//! `fmi2-component-build` makes it:
//!
//! ```sh
//! cargo install fmi2-component-build --features pack
//! cargo build --release
//! fmi2-pack modelDescription.xml target/release/libmy_component.so .
//! ```
//!
//! # What a component can rely on
//!
//! - [`Component::new`] is followed by the start values of the table, set through the component's own setters; a reset
//!   does the same.
//! - A setter is called only for a variable that may be set in the present state, and a real value is finite.
//! - [`Component::initialise`] is called before the first step, and in Initialization Mode before a computed value is
//!   read after something was set. Outputs that depend on inputs are thus right however often inputs are set.
//! - [`Component::step`] is called with a positive length that [`Component::accept_step`] has accepted; communication points
//!   follow each other within 1e-9 of their size.
//! - A panic does not leave the call: it is logged, and the instance can then only be freed.
//!
//! Masters read `min` and `max`; the shell does not enforce them: the component decides which values it accepts.
//!
//! # What is legal when
//!
//! The life cycle of FMI 2.0, clauses 3.2.3 and 4.2.4, of both interfaces. An illegal call answers `fmi2Error`, logs a
//! line that says where it would be legal, and changes nothing. *SetDiscrete* stands for the setters of integers,
//! Booleans and strings, *GetValues*, *GetStatus* and *FMUstate* for the functions of that family, *GetEquations* for
//! `fmi2GetContinuousStates`, `fmi2GetDerivatives` and `fmi2GetEventIndicators`.
//!
#![doc = include_str!("life_cycle.md")]
//!
//! Which variables may be set depends on causality, variability and initial besides: [`Variable::settable_at_start`],
//! [`Variable::settable_between_steps`], [`Variable::settable_in_continuous_time`].
//!
//! # What of FMI 2.0 is supported
//!
//! | feature | |
//! |---|---|
//! | co-simulation | all functions; a step is done when `fmi2DoStep` returns, so that there is none to cancel |
//! | model exchange | all functions, where the component is [`ModelExchange`]; else refused with a reason |
//! | real, integer, enumeration, Boolean, string variables | yes; no aliases (two variables with one value reference) |
//! | tunable parameters | between steps |
//! | several values in one call | all are set or none, whoever refuses one |
//! | FMU states: get, set, free | yes, by [`Clone`]; those that a master forgets are freed with the instance. The stop time is not part of them |
//! | FMU states: serialise | by [`Component::archive`]; blobs of another model, another version or damaged ones are refused |
//! | input and output derivatives, directional derivatives | where the component provides them |
//! | logging | categories of the description, `logStatusWarning` for warnings; reasons of refused calls always; text is safe as a printf format |
//! | status queries | what there is to tell after a discarded step |
//! | several models in one library | by [`Component::adopt`]: a model of another GUID, with further outputs, follows from the resources; co-simulation only |
//! | resource location | as `file:///…`, `file:////…`, `file:/…`, bare path; read by [`Component::adopt`] alone |
//! | allocation callbacks, `visible` | accepted, not used |
//! | tolerance | from 0 to 1, not used: a component finds out by itself what an integrator resolves |
//!
//! Once set up, setting and getting real values and stepping allocate nothing.

pub mod abi;
mod archive;
mod component;
mod export;
mod instance;
mod life_cycle;
mod log;
mod refusal;
mod resources;
mod variable;

pub use archive::Archive;
pub use component::{BooleanOf, Component, Discrete, IntegerOf, Key, Model, ModelExchange, RealOf, StringOf, foreign};
pub use log::{Category, Log, Logger};
pub use refusal::{Refusal, Status};
pub use resources::{Resources, guid_of};
pub use variable::{Causality, Initial, Variability, Variable};
