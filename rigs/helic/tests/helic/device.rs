//! Guards the device alone: parameters, errors, oscillator, output gate, watchdog and stream.

use vines_helic::codec::{ErrorCode, message};

use super::host::{Host, device, scene};

fn cosine(amplitude: f32) -> [f32; 33] {
    let mut coefficients = [0.0; 33];
    coefficients[1] = amplitude;
    coefficients
}

/// A host of a new device, with these settings.
fn host(settings: &[(&str, &[f32])]) -> Host {
    let mut host = Host::new(device());
    settings
        .iter()
        .for_each(|(name, values)| host.set(name, values).unwrap());
    host
}

#[test]
fn every_error_code_has_its_case() {
    use ErrorCode::{BadIndex, BadLength, BadValue, Busy, ReadOnly, UnknownType};
    let mut host = host(&[]);
    let table = host.parameters["table"].0.to_le_bytes();
    for (kind, payload, error) in [
        (5, &table[..], UnknownType),
        (6, &table, UnknownType),
        (128, &table, UnknownType),
        (message::GET_PAR, &[255, 0], BadIndex),
        (message::GET_PAR, &[0], BadLength),
        (message::GET_PAR, &table, BadLength),
        (message::GET_PARAMS, &[255, 0], BadIndex),
        (message::GET_PARAMS, &[], BadLength),
        (message::STATUS, &[0], BadLength),
        (message::STREAM_START, &[1, 0], BadValue),
    ] {
        assert_eq!(host.ask(kind, payload), Err(error), "{kind} {payload:?}");
    }
    for (name, values, error) in [
        ("ticks", &[1.0][..], ReadOnly),
        ("table_gain", &[2.0], ReadOnly),
        ("mcu_reboot", &[1.0], ReadOnly),
        ("freq", &[1.0, 2.0], BadLength),
        ("freq", &[f32::NAN], BadValue),
        ("freq", &[450.0], BadValue),
        ("forcing_coeffs", &cosine(10.1), BadValue),
        ("table_mode", &[1.0], BadValue),
        ("rig_watchdog", &[f32::INFINITY], BadValue),
        ("rig_watchdog", &[-0.1], BadValue),
        ("arm", &[2.0], BadValue),
    ] {
        assert_eq!(host.set(name, values), Err(error), "{name} {values:?}");
    }
    assert_eq!(host.set_up(&["out"], 0, 0), Err(BadValue));
    host.set_up(&["out"], 1, 0).unwrap();
    host.ask(message::STREAM_START, &[1, 0]).unwrap();
    assert_eq!(host.set_up(&["out"], 1, 0), Err(Busy));
    // A refused value leaves the one before.
    assert_eq!(host.get("freq"), 0);
}

#[test]
fn forcing_reaches_the_plant_only_when_armed_and_a_host_that_leaves_disarms() {
    let mut host = host(&[("freq", &[8.8]), ("forcing_coeffs", &cosine(0.1))]);
    let sources = ["forcing", "out", "reference"];
    let (_, quiet) = host.capture(&sources, 1, 200);
    assert!(quiet.iter().any(|record| record[0].abs() > 0.09));
    assert!(quiet.iter().all(|record| record[1..] == [0.0, 0.0]));
    host.set("arm", &[1.0]).unwrap();
    let (at, driven) = host.capture(&sources, 3, 100);
    assert!(at.windows(2).all(|pair| pair[1] - pair[0] == 3));
    assert!(driven.iter().all(|record| record[0] == record[1]));
    assert!(driven.iter().any(|record| record[2].abs() > 0.09));
    assert_eq!(host.get("safety"), 1);
    host.device.disconnect();
    host.tick(1);
    assert_eq!((host.get("arm"), host.get("safety")), (0, 8));
}

#[test]
fn parameters_and_sources_begin_and_end_with_those_of_version_3() {
    let base = "firmware experiment sample_freq ticks loop_time_last loop_time_max clock_jitter overruns tick_timeouts records_dropped freq \
                target_coeffs forcing_coeffs table table_len table_freq table_gain table_interp table_mode table_mult table_phase \
                table_trigger wake_phase_min wake_phase_max t_measure_max t_actuate_max t_rest_max diag_reset cmd_backlog_max arm \
                safety mcu_reboot";
    let host = host(&[]);
    for (index, name) in base.split_whitespace().enumerate() {
        assert_eq!(usize::from(host.parameters[name].0), index, "{name}");
    }
    let last = ["target", "forcing", "table", "phase", "out", "cmd_epoch"];
    assert_eq!(host.sources[host.sources.len() - last.len()..], last);
}

#[test]
fn the_source_phase_is_that_of_the_forcing_of_the_same_record() {
    let mut host = host(&[("forcing_coeffs", &cosine(1.0)), ("freq", &[8.8])]);
    let (_, records) = host.capture(&["phase", "forcing"], 1, 500);
    for record in &records {
        let error = record[1] - (std::f32::consts::TAU * record[0]).cos();
        assert!(error.abs() < 1e-5 && (0.0..=1.0).contains(&record[0]), "{record:?}");
    }
    assert!(records.iter().any(|record| record[0] > 0.9));
}

#[test]
fn the_watchdog_disarms_a_device_whose_host_is_silent_and_is_off_at_the_start() {
    let mut host = host(&[("forcing_coeffs", &cosine(0.1)), ("arm", &[1.0])]);
    let samples = (0.3 / scene().sample_time()) as u32;
    host.tick(samples);
    assert!(host.device.is_driven());
    host.set("rig_watchdog", &[0.2]).unwrap();
    for _ in 0..5 {
        host.tick(samples / 2);
        assert_eq!(host.get("safety"), 1);
    }
    host.tick(samples);
    assert_eq!((host.get("arm"), host.get("safety")), (0, 8));
}

#[test]
fn a_sum_above_the_limit_is_clamped_and_says_so() {
    let mut host = host(&[
        ("forcing_coeffs", &cosine(8.0)),
        ("target_coeffs", &cosine(8.0)),
        ("arm", &[1.0]),
    ]);
    let (_, records) = host.capture(&["out"], 1, 5);
    assert!(records.iter().all(|record| record[0] == 10.0));
    assert_eq!(host.get("safety"), 0b101);
}

#[test]
fn commands_are_counted_at_the_sample_that_they_take_effect() {
    let mut host = host(&[]);
    for (settings, count) in [
        (&[][..], 0.0),
        (&["freq", "diag_reset", "arm"], 1.0),
        (&["freq", "freq"], 3.0),
    ] {
        settings.iter().for_each(|name| host.set(name, &[1.0]).unwrap());
        assert_eq!(host.capture(&["cmd_epoch"], 1, 1).1[0][0], count);
    }
}
