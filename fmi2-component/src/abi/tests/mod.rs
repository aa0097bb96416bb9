//! The functions through their pointers, with a component and a master in this file and without a logger, so that Miri can run them: it
//! cannot load a library or call C.

use std::marker::PhantomData;
use std::ptr::{null, null_mut};

use super::*;
use crate::{Archive, Causality, Component, Discrete, Initial, Key, Log, Model, ModelExchange, Variability, Variable};

/// The model of `Lag`.
struct Table;

impl Model for Table {
    const NAME: &'static str = "Lag";
    const IDENTIFIER: &'static str = "Lag";
    const GUID: &'static str = "lag";
    const VERSION: &'static str = "0";
    const STATES: &'static [Real] = &[Real::X];
    const DERIVATIVES: &'static [Real] = &[Real::DerX];
    const EVENT_INDICATORS: usize = 1;
    const CATEGORIES: &'static [&'static str] = &["logEvents"];
    type Real = Real;
    type Integer = Nothing<i32>;
    type Boolean = Nothing<bool>;
    type String = Label;
}

const fn variable<T: Copy>(
    (name, value_reference): (&'static str, u32),
    (causality, variability): (Causality, Variability),
    initial: Option<Initial>,
    start: Option<T>,
) -> Variable<T> {
    Variable {
        name,
        value_reference,
        causality,
        variability,
        initial,
        start,
        min: None,
        max: None,
        nominal: None,
        unit: None,
        description: "",
    }
}

#[derive(Clone, Copy)]
enum Real {
    U,
    X,
    DerX,
}

impl Key for Real {
    type Value = f64;
    const VARIABLES: &'static [Variable<f64>] = &[
        variable(("u", 0), (Causality::Input, Variability::Continuous), None, Some(0.0)),
        variable(
            ("x", 1),
            (Causality::Output, Variability::Continuous),
            Some(Initial::Exact),
            Some(1.0),
        ),
        variable(
            ("der(x)", 2),
            (Causality::Local, Variability::Continuous),
            Some(Initial::Calculated),
            None,
        ),
    ];
    const ALL: &'static [Self] = &[Self::U, Self::X, Self::DerX];

    fn find(value_reference: u32) -> Option<Self> {
        Self::ALL.get(value_reference as usize).copied()
    }

    fn index(self) -> usize {
        self as usize
    }
}

#[derive(Clone, Copy)]
struct Label;

impl Key for Label {
    type Value = &'static str;
    const VARIABLES: &'static [Variable<&'static str>] = &[variable(
        ("label", 0),
        (Causality::Parameter, Variability::Fixed),
        Some(Initial::Exact),
        Some("lag"),
    )];
    const ALL: &'static [Self] = &[Self];

    fn find(value_reference: u32) -> Option<Self> {
        (value_reference == 0).then_some(Self)
    }

    fn index(self) -> usize {
        0
    }
}

/// No variable of type `T`.
#[derive(Clone, Copy)]
struct Nothing<T: 'static>(PhantomData<T>);

impl<T: Copy + 'static> Key for Nothing<T> {
    type Value = T;
    const VARIABLES: &'static [Variable<T>] = &[];
    const ALL: &'static [Self] = &[];

    fn find(_: u32) -> Option<Self> {
        None
    }

    fn index(self) -> usize {
        unreachable!()
    }
}

/// x' = u - x; panics where u is above 100.
#[derive(Clone, Default)]
struct Lag {
    u: f64,
    start: f64,
    x: f64,
    label: String,
}

impl Component for Lag {
    type Model = Table;

    fn new() -> Self {
        Self::default()
    }

    fn get_real(&self, variable: Real) -> f64 {
        match variable {
            Real::U => self.u,
            Real::X => self.x,
            Real::DerX => self.u - self.x,
        }
    }

    fn set_real(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        match variable {
            Real::U => self.u = value,
            Real::X => self.start = value,
            Real::DerX => unreachable!(),
        }
        Ok(())
    }

    fn get_string(&self, _: Label) -> &str {
        &self.label
    }

    fn set_string(&mut self, _: Label, value: &str) -> Result<(), Refusal> {
        self.label = value.into();
        Ok(())
    }

    fn initialise(&mut self, _: f64, _: &Log) -> Result<(), Refusal> {
        self.x = self.start;
        Ok(())
    }

    fn step(&mut self, _: f64, step: f64, _: &Log) -> Result<(), Refusal> {
        assert!(self.u <= 100.0);
        self.x += step * (self.u - self.x);
        Ok(())
    }

    fn partial_derivative(&self, _: Real, known: Real) -> Result<f64, Refusal> {
        Ok(if matches!(known, Real::U) { 1.0 } else { -1.0 })
    }

    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        for value in [&mut self.u, &mut self.start, &mut self.x] {
            archive.whole(value)?;
        }
        archive.whole(&mut self.label)
    }
}

impl ModelExchange for Lag {
    fn select(&mut self) {}

    fn set_state(&mut self, _: Real, value: f64) {
        self.x = value;
    }

    fn event_indicator(&self, _: usize) -> f64 {
        self.x - 0.5
    }

    fn new_discrete_states(&mut self, _: f64, _: &Log) -> Result<Discrete, Refusal> {
        Ok(Discrete::default())
    }
}

/// An instance in Initialization Mode.
fn new(interface: c_int) -> CComponent {
    let functions = CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: null_mut(),
    };
    let select: fn(&mut Lag) = Lag::select;
    // SAFETY: strings and callbacks are there during the call.
    unsafe {
        let (name, guid) = (c"one".as_ptr(), c"{lag}".as_ptr());
        let c = instantiate(name, interface, guid, null(), &raw const functions, 0, Some(select));
        assert!(!c.is_null());
        assert_eq!(setup_experiment::<Lag>(c, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
        assert_eq!(enter_initialization_mode::<Lag>(c), Status::Ok);
        c
    }
}

/// Two reals in memory that nobody has written before.
fn reals(c: CComponent, references: [u32; 2]) -> [f64; 2] {
    let mut values = MaybeUninit::<[f64; 2]>::uninit();
    // SAFETY: as many places as references; the call has written both.
    unsafe {
        let status = get_real::<Lag>(c, references.as_ptr(), 2, values.as_mut_ptr().cast());
        assert_eq!(status, Status::Ok);
        values.assume_init()
    }
}

#[test]
fn values_steps_and_states_go_through_the_pointers_of_co_simulation() {
    let c = new(1);
    // SAFETY: arrays are as long as their counts, and the instance is freed at the end.
    unsafe {
        let (text, mut read) = (c"\xc2\xb5".as_ptr(), null());
        assert_eq!(set_string::<Lag>(c, &0, 1, &raw const text), Status::Ok);
        assert_eq!(set_real::<Lag>(c, [0, 1].as_ptr(), 2, [2.0, 1.0].as_ptr()), Status::Ok);
        assert_eq!(exit_initialization_mode::<Lag>(c), Status::Ok);
        assert_eq!(get_string::<Lag>(c, &0, 1, &raw mut read), Status::Ok);
        assert_eq!(CStr::from_ptr(read).to_str(), Ok("µ"));
        assert_eq!(do_step::<Lag>(c, 0.0, 0.5, 0), Status::Ok);
        assert_eq!(reals(c, [1, 2]), [1.5, 0.5]);

        let mut states = [null_mut(); 2];
        assert_eq!(get_fmu_state::<Lag>(c, &raw mut states[0]), Status::Ok);
        let mut size = 0;
        assert_eq!(
            serialized_fmu_state_size::<Lag>(c, states[0], &raw mut size),
            Status::Ok
        );
        let mut bytes = vec![MaybeUninit::<c_char>::uninit(); size];
        let place = bytes.as_mut_ptr().cast::<c_char>();
        assert_eq!(serialize_fmu_state::<Lag>(c, states[0], place, size - 1), Status::Error);
        assert_eq!(serialize_fmu_state::<Lag>(c, states[0], place, size), Status::Ok);
        assert_eq!(
            deserialize_fmu_state::<Lag>(c, place, size, &raw mut states[1]),
            Status::Ok
        );
        for state in &mut states {
            assert_eq!(do_step::<Lag>(c, 0.5, 0.5, 0), Status::Ok);
            assert_eq!(reals(c, [0, 1]), [2.0, 1.75]);
            assert_eq!(set_fmu_state::<Lag>(c, *state), Status::Ok);
            assert_eq!(reals(c, [0, 1]), [2.0, 1.5]);
            assert_eq!(free_fmu_state::<Lag>(c, state), Status::Ok);
            assert!(state.is_null());
        }

        let mut slope = 0.0;
        let status =
            get_directional_derivative::<Lag>(c, &2, 1, [0, 1].as_ptr(), 2, [3.0, 1.0].as_ptr(), &raw mut slope);
        assert_eq!((status, slope), (Status::Ok, 2.0));
        let mut time = 0.0;
        assert_eq!(get_real_status::<Lag>(c, 2, &raw mut time), Status::Ok);
        assert_eq!(time, 0.5);
        let categories = [c"logEvents".as_ptr(), null()];
        assert_eq!(set_debug_logging::<Lag>(c, 1, 2, categories.as_ptr()), Status::Warning);
        free_instance::<Lag>(c);
        free_instance::<Lag>(null_mut());
    }
}

#[test]
fn arrays_that_are_missing_misaligned_or_too_long_are_refused_and_a_panic_leaves_an_instance_that_can_be_freed() {
    let c = new(1);
    let mut values = [0.0; 2];
    // SAFETY: what is not an array of that length is refused before it is read.
    unsafe {
        assert_eq!(exit_initialization_mode::<Lag>(c), Status::Ok);
        let misaligned = values.as_mut_ptr().cast::<u8>().add(1).cast();
        for (count, place) in [(1, null_mut()), (1, misaligned), (usize::MAX, values.as_mut_ptr())] {
            assert_eq!(get_real::<Lag>(c, &0, count, place), Status::Error);
            assert_eq!(set_real::<Lag>(c, &0, count, place), Status::Error);
        }
        assert_eq!(get_real::<Lag>(c, null(), 0, null_mut()), Status::Ok);
        assert_eq!(get_real::<Lag>(null_mut(), &0, 1, values.as_mut_ptr()), Status::Error);
        assert_eq!(set_real::<Lag>(c, &0, 1, &101.0), Status::Ok);
        assert_eq!(do_step::<Lag>(c, 0.0, 0.5, 0), Status::Fatal);
        assert_eq!(get_real::<Lag>(c, &0, 1, values.as_mut_ptr()), Status::Fatal);
        free_instance::<Lag>(c);
    }
}

#[test]
fn states_derivatives_and_events_go_through_the_pointers_of_model_exchange() {
    let c = new(0);
    // SAFETY: arrays are as long as their counts, the call has written the information, and the instance is freed at the end.
    unsafe {
        assert_eq!(exit_initialization_mode::<Lag>(c), Status::Ok);
        let mut info = MaybeUninit::uninit();
        assert_eq!(new_discrete_states::<Lag>(c, info.as_mut_ptr()), Status::Ok);
        assert_eq!(info.assume_init(), EventInfo::default());
        assert_eq!(enter_continuous_time_mode::<Lag>(c), Status::Ok);
        let [mut x, mut slope, mut indicator, mut nominal] = [0.0; 4];
        assert_eq!(get_continuous_states::<Lag>(c, &raw mut x, 1), Status::Ok);
        assert_eq!(x, 1.0);
        assert_eq!(set_time::<Lag>(c, 0.5), Status::Ok);
        assert_eq!(set_continuous_states::<Lag>(c, &0.25, 1), Status::Ok);
        assert_eq!(get_derivatives::<Lag>(c, &raw mut slope, 1), Status::Ok);
        assert_eq!(get_event_indicators::<Lag>(c, &raw mut indicator, 1), Status::Ok);
        assert_eq!(
            get_nominals_of_continuous_states::<Lag>(c, &raw mut nominal, 1),
            Status::Ok
        );
        assert_eq!([slope, indicator, nominal], [-0.25, -0.25, 1.0]);
        let mut flags = [CBoolean::MAX; 2];
        let [event, terminate] = &mut flags;
        assert_eq!(completed_integrator_step::<Lag>(c, 1, event, terminate), Status::Ok);
        assert_eq!(flags, [0, 0]);
        assert_eq!(get_derivatives::<Lag>(c, &raw mut slope, 2), Status::Error);
        assert_eq!(enter_event_mode::<Lag>(c), Status::Ok);
        free_instance::<Lag>(c);
    }
}
