//! What an FMU logs, as a record of the crate `log`.

use std::ffi::{CStr, c_int};

use log::{Level, Record};

use super::{fmi2ComponentEnvironment, fmi2Status, fmi2String};

unsafe extern "C" {
    /// In logger.c.
    pub fn callback_logger_handler(
        environment: fmi2ComponentEnvironment,
        instance: fmi2String,
        status: fmi2Status,
        category: fmi2String,
        message: fmi2String,
        ...
    );
}

/// Called by logger.c with the complete message.
#[unsafe(no_mangle)]
extern "C" fn vines_fmi2_log(instance: fmi2String, status: c_int, message: fmi2String) {
    let level = match status {
        0 => Level::Info,
        1 => Level::Warn,
        2 => Level::Trace,
        _ => Level::Error,
    };
    // Safety: the standard has them end with NUL, and they live until this function returns.
    let text = |from: fmi2String| (!from.is_null()).then(|| unsafe { CStr::from_ptr(from) }.to_string_lossy());
    let [instance, message] = [instance, message].map(|from| text(from).unwrap_or("NULL".into()));
    log::logger().log(
        &Record::builder()
            .args(format_args!("{message}"))
            .level(level)
            .module_path(Some("logger"))
            .target(&instance)
            .build(),
    );
}
