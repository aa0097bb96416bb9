//! Guards the device alone: parameters, errors, oscillator, output gate, watchdog and stream.

use vines_helic::codec::{ErrorCode, message};

use super::host::{Host, device, scene};

fn cosine(amplitude: f32) -> [f32; 33] {
    let mut coefficients = [0.0; 33];
    coefficients[1] = amplitude;
    coefficients
}

#[test]
fn every_error_code_has_its_case() {
    let mut host = Host::new(device());
    let table = host.parameters["table"].0.to_le_bytes();
    for kind in [message::SET_BLOCK, message::COMMIT, 128] {
        assert_eq!(host.ask(kind, &table), Err(ErrorCode::UnknownType));
    }
    assert_eq!(host.ask(message::GET_PAR, &[255, 0]), Err(ErrorCode::BadIndex));
    assert_eq!(host.ask(message::GET_PAR, &[0]), Err(ErrorCode::BadLength));
    assert_eq!(host.ask(message::GET_PAR, &table), Err(ErrorCode::BadLength));
    assert_eq!(host.ask(message::GET_PARAMS, &[255, 0]), Err(ErrorCode::BadIndex));
    assert_eq!(host.ask(message::GET_PARAMS, &[]), Err(ErrorCode::BadLength));
    assert_eq!(host.set("ticks", &[1.0]), Err(ErrorCode::ReadOnly));
    assert_eq!(host.set("freq", &[1.0, 2.0]), Err(ErrorCode::BadLength));
    assert_eq!(host.set("freq", &[f32::NAN]), Err(ErrorCode::BadValue));
    assert_eq!(host.set("freq", &[450.0]), Err(ErrorCode::BadValue));
    assert_eq!(host.set("forcing_coeffs", &cosine(10.1)), Err(ErrorCode::BadValue));
    assert_eq!(host.set("table_gain", &[2.0]), Err(ErrorCode::ReadOnly));
    assert_eq!(host.set("table_mode", &[1.0]), Err(ErrorCode::BadValue));
    assert_eq!(host.set("mcu_reboot", &[1.0]), Err(ErrorCode::ReadOnly));
    assert_eq!(host.set("rig_watchdog", &[f32::INFINITY]), Err(ErrorCode::BadValue));
    assert_eq!(host.set("arm", &[2.0]), Err(ErrorCode::BadValue));
    assert_eq!(host.ask(message::STREAM_START, &[1, 0]), Err(ErrorCode::BadValue));
    assert_eq!(host.set_up(&["out"], 0, 0), Err(ErrorCode::BadValue));
    host.set_up(&["out"], 1, 0).unwrap();
    host.ask(message::STREAM_START, &[1, 0]).unwrap();
    assert_eq!(host.set_up(&["out"], 1, 0), Err(ErrorCode::Busy));
    // A refused value leaves the one before.
    assert_eq!(host.get("freq"), 0f32.to_le_bytes());
}

#[test]
fn forcing_reaches_the_plant_only_when_armed_and_a_host_that_leaves_disarms() {
    let mut host = Host::new(device());
    host.set("freq", &[8.8]).unwrap();
    host.set("forcing_coeffs", &cosine(0.1)).unwrap();
    let (_, quiet) = host.capture(&["forcing", "out", "reference"], 1, 200);
    assert!(quiet.iter().any(|record| record[0].abs() > 0.09));
    assert!(quiet.iter().all(|record| record[1..] == [0.0, 0.0]));
    host.set("arm", &[1.0]).unwrap();
    let (at, driven) = host.capture(&["forcing", "out", "reference"], 3, 100);
    assert!(at.windows(2).all(|pair| pair[1] - pair[0] == 3));
    assert!(driven.iter().all(|record| record[0] == record[1]));
    assert!(driven.iter().any(|record| record[2].abs() > 0.09));
    assert_eq!(host.number("safety"), 1);
    host.device.disconnect();
    host.device.tick().unwrap();
    assert_eq!((host.number("arm"), host.number("safety")), (0, 8));
}

#[test]
fn parameters_and_sources_begin_and_end_with_those_of_version_3() {
    let base = "firmware experiment sample_freq ticks loop_time_last loop_time_max clock_jitter overruns tick_timeouts records_dropped freq \
                target_coeffs forcing_coeffs table table_len table_freq table_gain table_interp table_mode table_mult table_phase \
                table_trigger wake_phase_min wake_phase_max t_measure_max t_actuate_max t_rest_max diag_reset cmd_backlog_max arm \
                safety mcu_reboot";
    let mut host = Host::new(device());
    for (index, name) in base.split_whitespace().enumerate() {
        assert_eq!(usize::from(host.parameters[name].0), index, "{name}");
    }
    let sources = host.sources();
    let last = ["target", "forcing", "table", "phase", "out", "cmd_epoch"];
    assert_eq!(sources[sources.len() - last.len()..], last);
}

#[test]
fn the_source_phase_is_that_of_the_forcing_of_the_same_record() {
    let mut host = Host::new(device());
    host.set("forcing_coeffs", &cosine(1.0)).unwrap();
    host.set("freq", &[8.8]).unwrap();
    let (_, records) = host.capture(&["phase", "forcing"], 1, 500);
    for record in &records {
        let expected = (std::f32::consts::TAU * record[0]).cos();
        assert!(
            (record[1] - expected).abs() < 1e-5 && (0.0..=1.0).contains(&record[0]),
            "{record:?}"
        );
    }
    assert!(records.iter().any(|record| record[0] > 0.9));
}

#[test]
fn the_watchdog_disarms_a_device_whose_host_is_silent_and_is_off_at_the_start() {
    let mut host = Host::new(device());
    host.set("forcing_coeffs", &cosine(0.1)).unwrap();
    host.set("arm", &[1.0]).unwrap();
    let samples = (0.3 / scene().sample_time()) as u32;
    let ticks = |host: &mut Host| (0..samples).for_each(|_| drop(host.device.tick().unwrap()));
    ticks(&mut host);
    assert!(host.device.is_driven());
    host.set("rig_watchdog", &[0.2]).unwrap();
    assert_eq!(host.set("rig_watchdog", &[-0.1]), Err(ErrorCode::BadValue));
    let half = |host: &mut Host| (0..samples / 2).for_each(|_| drop(host.device.tick().unwrap()));
    for _ in 0..5 {
        half(&mut host);
        assert_eq!(host.number("safety"), 1);
    }
    ticks(&mut host);
    assert_eq!((host.number("arm"), host.number("safety")), (0, 8));
}

#[test]
fn a_sum_above_the_limit_is_clamped_and_says_so() {
    let mut host = Host::new(device());
    host.set("forcing_coeffs", &cosine(8.0)).unwrap();
    host.set("target_coeffs", &cosine(8.0)).unwrap();
    host.set("arm", &[1.0]).unwrap();
    let (_, records) = host.capture(&["out"], 1, 5);
    assert!(records.iter().all(|record| record[0] == 10.0));
    assert_eq!(host.number("safety"), 0b101);
}

#[test]
fn commands_are_counted_at_the_sample_that_they_take_effect() {
    let mut host = Host::new(device());
    let epoch = |host: &mut Host| host.capture(&["cmd_epoch"], 1, 1).1[0][0];
    assert_eq!(epoch(&mut host), 0.0);
    host.set("freq", &[1.0]).unwrap();
    host.set("diag_reset", &[1.0]).unwrap();
    host.set("arm", &[1.0]).unwrap();
    assert_eq!(epoch(&mut host), 1.0);
    host.set("freq", &[1.5]).unwrap();
    host.set("freq", &[2.0]).unwrap();
    assert_eq!(epoch(&mut host), 3.0);
}
