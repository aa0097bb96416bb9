//! Guards the plant's library as that of `Structure.fmu`: the bits of the plant in Rust, FMU states, and resources that are missing, of
//! another FMU or damaged.

use std::ffi::{CString, c_int};
use std::path::PathBuf;
use std::ptr::null;

use fmi2_boundary::{Fmu, Interface, Master, call, refused};
use fmi2_component::Status;
use lovines::host::Equations;
use lovines::{Cavity, Drive, Excitation, Host, Mode, Parameters, Plant, Structure, StructureState};

/// Value references: m, b, r, signal, amplitude, omega, w, the drive's total, tilt.
const M: u32 = 3;
const R: u32 = 5;
const SIGNAL: u32 = 6;
const AMPLITUDE: u32 = 7;
const OMEGA: u32 = 8;
const Q2: u32 = 11;
const DQ2: u32 = 12;
const W: u32 = 14;
const DRIVE: u32 = 16;
const ENERGY: u32 = 22;
const TILT: u32 = 35;
/// Displacement, velocity and acceleration at the first two points.
const POINTS: [u32; 6] = [1000, 1001, 1002, 1003, 1004, 1005];

const START: &str = r#""parameters": {"M": 3.807, "k": 11680.0, "c": 2.53, "m": 0.032, "b": 0.01, "r": 0.65}, "particle": [0.001, 0.4]"#;

/// Two modes and a force.
fn frame() -> String {
    format!(
        r#"{{"excitation": "Force", "equations": {{"modes": [
            {{"omega": 55.39, "zeta": 0.006, "cavity": 0.51252, "drive": 0.3}},
            {{"omega": 347.3, "zeta": 0.009, "cavity": -0.51252, "drive": 0.4}}]}},
        "points": [{{"name": "tip", "row": [[0.51252, 0.0], [-0.51252, 0.0]]}}, {{"name": "root", "row": [[0.1, 0.0], [0.3, 0.0]]}}], {START}}}"#
    )
}

const MASS: [[f64; 2]; 2] = [[3.5, 0.0], [0.0, 2.0]];
const DAMPING: [[f64; 2]; 2] = [[3.0, -1.0], [-1.0, 9.0]];
const STIFFNESS: [[f64; 2]; 2] = [[11000.0, -4000.0], [-4000.0, 90000.0]];

/// Matrices whose damping couples the modes, on a base.
fn chain() -> String {
    let (host, points) = chain_host();
    let [tip, root] = points.map(|point| host.row(&point).unwrap());
    format!(
        r#"{{"excitation": "Base", "equations": {{"matrices": {{"mass": {MASS:?}, "damping": {DAMPING:?}, "stiffness": {STIFFNESS:?},
            "cavity": [1.0, 0.0], "drive": [1.0, 1.0]}}}},
        "points": [{{"name": "tip", "row": {tip:?}}}, {{"name": "root", "row": {root:?}}}], {START}}}"#
    )
}

fn chain_host() -> (Host, [[f64; 2]; 2]) {
    let rows = |matrix: [[f64; 2]; 2]| matrix.map(|row| row.to_vec()).to_vec();
    let equations = Equations::Matrices {
        mass: rows(MASS),
        damping: rows(DAMPING),
        stiffness: rows(STIFFNESS),
        cavity: vec![1.0, 0.0],
        drive: vec![1.0, 1.0],
        states: vec![],
    };
    (equations.host(Excitation::Base).unwrap(), [[1.0, 0.0], [0.0, 1.0]])
}

fn frame_host() -> (Host, [[f64; 2]; 2]) {
    let modes = [(55.39, 0.006, 0.51252, 0.3), (347.3, 0.009, -0.51252, 0.4)];
    let modes = modes.map(|(omega, zeta, cavity, drive)| Mode { omega, zeta, cavity, drive });
    (
        Host::from_modes(Excitation::Force, &modes).unwrap(),
        [[0.51252, -0.51252], [0.1, 0.3]],
    )
}

/// The plant in Rust, and the rows of its points.
fn plant((host, points): (Host, [[f64; 2]; 2]), parameters: Parameters) -> (Plant<Structure>, [Vec<[f64; 2]>; 2]) {
    let rows = points.map(|point| host.row(&point).unwrap());
    let start = StructureState { q2: 0.001, dq2: 0.4, ..StructureState::default() };
    (Plant::with_host(host, parameters, &start).unwrap(), rows)
}

fn parameters() -> Parameters {
    Parameters {
        primary_mass: 3.807,
        stiffness: 11680.0,
        damping: 2.53,
        particle_mass: 0.032,
        half_width: 0.01,
        restitution: 0.65,
        cavity: Cavity::IDEAL,
    }
}

/// Resources in a folder of their own, which is removed with them.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, content: &[u8]) -> Self {
        let folder = std::env::temp_dir().join(format!("structure ä {name} {}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("structure.json"), content).unwrap();
        Self(folder)
    }

    /// An instance for the description with that GUID.
    fn instance(&self, kind: c_int, guid: &str) -> Master {
        let location = format!(
            "file:///{}",
            self.0.to_str().unwrap().trim_start_matches('/').replace(' ', "%20")
        );
        instance(kind, guid, Some(&location))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn instance(kind: c_int, guid: &str, location: Option<&str>) -> Master {
    let [guid, location] = [guid, location.unwrap_or_default()].map(|text| CString::new(text).unwrap());
    let place = if location.is_empty() { null() } else { location.as_ptr() };
    Master::instantiate(Fmu::plant().functions, kind, [c"rig".as_ptr(), guid.as_ptr(), place])
}

fn guid(content: &str) -> String {
    fmi2_component::guid_of(&Fmu::plant().guid(), content.as_bytes())
}

/// An instance of a structure, not initialized.
fn new(name: &str, content: &str) -> Master {
    let m = Folder::new(name, content.as_bytes()).instance(Interface::CoSimulation as c_int, &guid(content));
    assert!(!m.c.is_null(), "{:?}", m.heard());
    m
}

fn started(name: &str, content: &str) -> Master {
    let m = new(name, content);
    m.start();
    m
}

/// The drive of a step: an oscillator, jumps and slopes.
fn drive(n: u32, scale: f64) -> Drive {
    let x = f64::from(n % 13) / 13.0;
    Drive {
        signal: [scale * x, scale * (x - 0.5), 0.0, 0.0],
        amplitude: scale * (1.0 + x),
        omega: 54.8 + x,
    }
}

fn bits<const N: usize>(values: [f64; N]) -> [u64; N] {
    values.map(f64::to_bits)
}

#[test]
fn the_outputs_have_the_bits_of_the_plant_in_rust_at_1_and_at_100_steps_a_period() {
    for (name, content, host, scale) in [
        ("frame", frame(), frame_host(), 1.2),
        ("chain", chain(), chain_host(), 4e-4),
    ] {
        for steps in [1, 100] {
            let (m, (mut plant, rows)) = (new(name, &content), plant(host.clone(), parameters()));
            let [of_signal, of_amplitude, of_omega] = [SIGNAL, AMPLITUDE, OMEGA];
            let begin = Drive { amplitude: scale, omega: 54.8, ..Drive::default() };
            m.well(m.set_reals(&[of_amplitude, of_omega], &[scale, 54.8]));
            m.start();
            plant.begin(begin).unwrap();
            let step = 0.1146 / f64::from(steps);
            for n in 0..100 * steps {
                let drive = drive(n, scale);
                m.well(m.set_reals(
                    &[of_signal, of_amplitude, of_omega],
                    &[drive.signal[0], drive.amplitude, drive.omega],
                ));
                m.well(call!(m.fmi2SetRealInputDerivatives(&SIGNAL, 1, &1, &drive.signal[1])));
                m.well(m.step(f64::from(n) * step, step));
                plant.set_time(f64::from(n) * step);
                plant.advance(drive, step).unwrap();
                let [a, b] = rows.each_ref().map(|row| plant.point(row));
                let points = [a[0], a[1], a[2], b[0], b[1], b[2]];
                assert_eq!(bits(m.reals(&POINTS)), bits(points), "{name}, step {n}");
                let (state, w) = (plant.state(), plant.relative_displacement());
                let expected = [state.q2, state.dq2, w, plant.base_displacement(), plant.energy()];
                assert_eq!(
                    bits(m.reals(&[Q2, DQ2, W, DRIVE, ENERGY])),
                    bits(expected),
                    "{name}, step {n}"
                );
            }
            assert_eq!(m.impacts() as u64, plant.totals().impacts);
            assert!(m.impacts() > 100, "{name}: {}", m.impacts());
        }
    }
}

#[test]
fn parameters_of_particle_and_cavity_can_be_set_and_a_reset_leads_back_to_the_resources() {
    let content = frame();
    let m = new("parameters", &content);
    let (mut plain, _) = plant(frame_host(), parameters());
    let changed = Parameters { particle_mass: 0.05, restitution: 0.5, ..parameters() };
    let (mut other, _) = plant(frame_host(), changed);
    m.well(m.set_reals(&[M, R], &[0.05, 0.5]));
    m.start();
    let run = |m: &Master, plant: &mut Plant<Structure>, from: u32| {
        for n in from..from + 400 {
            m.well(m.step(f64::from(n) * 0.01, 0.01));
            plant.set_time(f64::from(n) * 0.01);
            plant.advance(Drive::default(), 0.01).unwrap();
        }
        assert_eq!(m.real(W).to_bits(), plant.relative_displacement().to_bits());
    };
    run(&m, &mut other, 0);
    // A tilted axis, from now on.
    let tilted = Parameters { cavity: Cavity { tilt: 0.1, ..Cavity::IDEAL }, ..changed };
    m.well(m.set_real(TILT, 0.1));
    other.set_parameters(tilted).unwrap();
    run(&m, &mut other, 400);
    assert!(m.impacts() > 20);
    m.well(call!(m.fmi2Reset()));
    m.start();
    assert_eq!(m.reals(&[M, R, Q2, DQ2]), [0.032, 0.65, 0.001, 0.4]);
    run(&m, &mut plain, 0);
}

#[test]
fn states_are_taken_set_back_and_carried_to_another_instance_of_the_same_structure_only() {
    let content = frame();
    let (m, other) = (started("states", &content), new("states of another", &content));
    let run = |m: &Master, from: u32| {
        for n in from..from + 300 {
            m.well(m.set_reals(&[AMPLITUDE, OMEGA], &[1.2, 54.8 + f64::from(n % 7) / 7.0]));
            m.well(m.step(f64::from(n) * 0.013, 0.013));
        }
        (m.bytes(), bits(m.reals(&POINTS)))
    };
    run(&m, 0);
    let mut state = std::ptr::null_mut();
    m.well(call!(m.fmi2GetFMUstate(&mut state)));
    let (taken, first) = (m.bytes(), run(&m, 300));
    m.well(call!(m.fmi2SetFMUstate(state)));
    assert_eq!(run(&m, 300), first);
    // Another instance does not disturb the first, and continues from its state.
    other.well(other.set_real(M, 0.1));
    other.start();
    run(&other, 0);
    other.well(other.restore(&taken));
    assert_eq!(run(&other, 300), first);
    assert!(m.impacts() > 50);
    let foreign = started("states of a foreign", &chain());
    assert_eq!(foreign.restore(&taken), Status::Error);
    assert_eq!(Master::ready(&Fmu::plant()).restore(&taken), Status::Error);
    let mut damaged = taken;
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    assert_eq!(m.restore(&damaged), Status::Error);
}

#[test]
fn what_a_structure_does_not_have_is_refused_in_one_sentence() {
    let content = frame();
    let m = new("refusals", &content);
    refused!(m.fmi2SetReal(&0, 1, &4.0) => "M cannot be set", "structure");
    refused!(m.fmi2SetReal(&9, 1, &0.001) => "q1 cannot be set", "starts at rest");
    refused!(m.fmi2SetReal(&1000, 1, &0.0) => "value reference 1000");
    m.well(m.set_real(Q2, 0.02));
    m.enter_initialization();
    refused!(m.fmi2GetReal(&1000, 1, &mut 0.0) => "outside its cavity");
    refused!(m.fmi2ExitInitializationMode() => "outside its cavity");
    m.well(m.set_real(Q2, 0.002));
    m.well(call!(m.fmi2ExitInitializationMode()));
    refused!(m.fmi2GetReal(&1006, 1, &mut 0.0) => "value reference 1006 is unknown", "from 1000 to 1005");
    refused!(m.fmi2SetReal(&M, 1, &0.05) => "m cannot be set");
    refused!(m.fmi2GetRealOutputDerivatives(&9, 1, &1, &mut 0.0) => "derivatives");
    m.well(m.set_real(SIGNAL, 1e300));
    refused!(m.fmi2DoStep(0.0, 0.01, 1) => "1e300");
    m.well(m.set_real(SIGNAL, 1e20));
    refused!(m.fmi2DoStep(0.0, 0.01, 1) => "2^52");
    m.well(m.set_real(SIGNAL, 1.0));
    refused!(m.fmi2DoStep(0.0, 1e6, 1) => "communicationStepSize");
    m.well(m.step(0.0, 0.01));
}

#[test]
fn resources_that_are_missing_or_of_another_fmu_are_refused_in_one_sentence() {
    let (content, own) = (frame(), Fmu::plant().guid());
    let of_frame = guid(&content);
    let folder = Folder::new("missing", content.as_bytes());
    let exchange = folder.instance(Interface::ModelExchange as c_int, &of_frame);
    exchange.expect(Status::Error, Status::Error, &["co-simulation (1) only"]);
    for (m, parts) in [
        (instance(1, &of_frame, None), ["NULL", &own]),
        (
            instance(1, &of_frame, Some("file:///nowhere/resources")),
            ["nowhere", "structure.json"],
        ),
        (
            folder.instance(1, &guid(&chain())),
            [of_frame.as_str(), "damaged or of another FMU"],
        ),
        (folder.instance(1, "0-0"), ["0-0", "damaged or of another FMU"]),
    ] {
        assert!(m.c.is_null());
        m.expect(Status::Error, Status::Error, &parts);
    }
    // The library's own description needs no resources, and does not look at them.
    let oscillator = folder.instance(1, &own);
    oscillator.start();
    refused!(oscillator.fmi2GetReal(&1000, 1, &mut 0.0) => "value reference 1000 is unknown");
}

/// Changes digits, or else damages bytes, cuts, or repeats a part.
fn mutated(content: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = content.to_vec();
    if random.bool() {
        let digits: Vec<usize> = (0..bytes.len()).filter(|&n| bytes[n].is_ascii_digit()).collect();
        for _ in 0..random.usize(1..4) {
            bytes[*random.choice(&digits).unwrap()] = random.u8(b'0'..=b'9');
        }
        return bytes;
    }
    for _ in 0..random.usize(1..4) {
        let place = random.usize(..bytes.len());
        match random.u8(..5) {
            0 => bytes[place] = random.u8(..),
            1 => bytes[place] = *random.choice(b"0123456789-e.,:[]{}\"").unwrap(),
            2 => bytes.truncate(place.max(1)),
            3 => drop(bytes.drain(place..(place + random.usize(..20)).min(bytes.len()))),
            _ => bytes.extend_from_within(place..),
        }
        if bytes.is_empty() {
            bytes.push(b' ');
        }
    }
    bytes
}

#[test]
fn damaged_resources_are_one_sentence_and_never_a_crash() {
    let mut random = fastrand::Rng::with_seed(48);
    let (mut accepted, mut refused) = (0, 0);
    for n in 0..200 {
        let content = if n % 2 == 0 { frame() } else { chain() };
        let damaged = mutated(content.as_bytes(), &mut random);
        if damaged == content.as_bytes() {
            continue;
        }
        let folder = Folder::new("damaged", &damaged);
        let said = |m: &Master| {
            let heard = m.heard();
            let one = heard.len() == 1 && heard[0].status == Status::Error && heard[0].text.contains("structure.json");
            assert!(m.c.is_null() && one, "{heard:?}");
        };
        said(&folder.instance(1, &guid(&content)));
        // As if the description had been made for the damaged file.
        let m = folder.instance(1, &fmi2_component::guid_of(&Fmu::plant().guid(), &damaged));
        if m.c.is_null() {
            refused += 1;
            let heard = m.heard();
            assert!(heard.len() == 1 && heard[0].status == Status::Error, "{heard:?}");
            continue;
        }
        accepted += 1;
        m.enter_initialization();
        let mut status = call!(m.fmi2ExitInitializationMode());
        for step in 0..3 {
            if status == Status::Ok {
                status = m.step(f64::from(step) * 0.01, 0.01);
            }
        }
        assert_ne!(
            status,
            Status::Fatal,
            "{:?}\n{}",
            m.heard(),
            String::from_utf8_lossy(&damaged)
        );
    }
    assert!(accepted > 40 && refused > 80, "{accepted} {refused}");
}
