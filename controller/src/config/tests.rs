//! Tests of the table of the parameters.

use super::*;

#[test]
fn a_value_that_was_set_is_the_value_that_is_got() {
    for parameter in &PARAMETERS {
        let mut config = Config::for_resonance(55.0, 1e-4);
        let before = config;
        let value = match parameter.get(&config) {
            Value::Real(value) => Value::Real(0.5 * value + 0.125),
            Value::Integer(1) => Value::Integer(2),
            Value::Integer(_) => Value::Integer(1),
            Value::Boolean(value) => Value::Boolean(!value),
        };
        parameter.set(&mut config, value).expect(parameter.name);
        assert_eq!(parameter.get(&config), value, "{}", parameter.name);
        let changed = PARAMETERS
            .iter()
            .filter(|other| other.get(&config) != other.get(&before));
        assert_eq!(changed.count(), 1, "{}", parameter.name);
    }
}

#[test]
fn an_option_is_absent_only_at_the_number_for_none() {
    let parameter = Parameter::find("response_max").expect("a parameter");
    let mut config = Config::for_resonance(55.0, 1e-4);
    for (value, expected) in [(NONE, None), (0.1, Some(0.1)), (0.0, Some(0.0)), (-2.0, Some(-2.0))] {
        parameter.set(&mut config, Value::Real(value)).expect("a real number");
        assert_eq!(config.response_max, expected);
        assert_eq!(config.build().is_ok(), value == NONE || value > 0.0, "{value}");
    }
    config.response_max = Some(NONE);
    assert!(config.build().is_err());
}

#[test]
fn a_value_of_another_type_is_refused_by_name_and_unit() {
    let mut config = Config::for_resonance(55.0, 1e-4);
    let refused = Parameter::find("delay")
        .expect("a parameter")
        .set(&mut config, Value::Integer(-3))
        .expect_err("an integer is refused");
    assert_eq!((refused.name, refused.value, refused.unit), ("delay", Some(-3.0), "s"));
}

#[test]
fn a_whole_number_out_of_range_is_refused_at_once() {
    let mut config = Config::for_resonance(55.0, 1e-4);
    for (name, value) in [("harmonics", 9), ("harmonics", -1), ("lock.dwell", 0), ("detector", 3)] {
        let refused = Parameter::find(name)
            .expect("a parameter")
            .set(&mut config, Value::Integer(value));
        assert_eq!(refused.expect_err(name).value, Some(f64::from(value)));
    }
}
