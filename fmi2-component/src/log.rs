//! Lines for the master's logger (FMI 2.0, clause 2.1.5): categories, and text that is safe as a printf format.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::fmt::Arguments;

use crate::refusal::Status;

/// `fmi2CallbackLogger`.
pub type Logger = unsafe extern "C" fn(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: Status,
    category: *const c_char,
    message: *const c_char,
    ...
);

/// The standard's category of warnings.
const WARNING: &str = "logStatusWarning";

/// A category of log lines that the description declares; generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Category {
    name: &'static str,
    bit: u64,
}

impl Category {
    /// The category at `index` of the description's list, which has at most 64.
    pub const fn new(index: u32, name: &'static str) -> Self {
        Self { name, bit: 1 << index }
    }
}

/// Where a component's log lines go.
///
/// Lines of a category appear only while the master has switched it on; so do warnings, in the category `logStatusWarning`. The
/// reason why a call returns a warning or an error always appears: the status alone does not say it.
#[derive(Debug)]
pub struct Log {
    sink: Option<Sink>,
    enabled: u64,
    categories: &'static [&'static str],
    /// The subjects that an instance has warned of.
    warned: RefCell<Vec<&'static str>>,
}

#[derive(Debug)]
struct Sink {
    logger: Logger,
    environment: *mut c_void,
    instance_name: CString,
}

impl Log {
    /// A log that calls `logger`, if there is one.
    ///
    /// # Safety
    /// As long as the log lives, `logger` can be called with `environment`, as `fmi2Instantiate` promises.
    pub(crate) unsafe fn new(
        logger: Option<Logger>,
        environment: *mut c_void,
        instance_name: &CStr,
        categories: &'static [&'static str],
    ) -> Self {
        Self {
            sink: logger.map(|logger| Sink { logger, environment, instance_name: instance_name.into() }),
            enabled: 0,
            categories,
            warned: RefCell::new(Vec::new()),
        }
    }

    /// Whether lines of `category` are wanted.
    #[inline]
    pub fn wants(&self, category: Category) -> bool {
        self.enabled & category.bit != 0
    }

    /// Logs a line, if the category is wanted; formats nothing if it is not.
    #[inline]
    pub fn tell(&self, category: Category, message: Arguments<'_>) {
        if self.wants(category) {
            self.write(Status::Ok, category.name, &message.to_string());
        }
    }

    /// Whether warnings are wanted: as a category of their own, or with all others where the description declares none.
    fn wants_warnings(&self) -> bool {
        match self.categories.iter().position(|&c| c == WARNING) {
            Some(index) => self.enabled & 1 << index != 0,
            None => self.enabled == u64::MAX,
        }
    }

    /// Logs a line about something that is not quite right, if warnings are wanted.
    #[cold]
    pub fn warn(&self, message: Arguments<'_>) {
        if self.wants_warnings() {
            self.write(Status::Warning, WARNING, &message.to_string());
        }
    }

    /// Logs a warning the first time that `subject` comes up while warnings are wanted, whatever is reset or rolled back: what
    /// happens in every step would otherwise fill the master's log.
    #[cold]
    pub fn warn_once(&self, subject: &'static str, message: Arguments<'_>) {
        let mut warned = self.warned.borrow_mut();
        if self.wants_warnings() && !warned.contains(&subject) {
            warned.push(subject);
            // The logger may call back.
            drop(warned);
            self.warn(message);
        }
    }

    /// Logs why a call ends in `status`.
    #[cold]
    pub(crate) fn reason(&self, status: Status, message: &str) {
        let category = if status == Status::Warning {
            WARNING
        } else {
            "logStatusError"
        };
        self.write(status, category, message);
    }

    /// Switches every category on or off.
    pub(crate) fn enable_all(&mut self, on: bool) {
        self.enabled = if on { u64::MAX } else { 0 };
    }

    /// Switches on the categories named and no other; answers whether each of them exists.
    pub(crate) fn enable_only<'a>(&mut self, names: impl Iterator<Item = &'a str>) -> bool {
        self.enabled = 0;
        let mut all_exist = true;
        for name in names {
            match self.categories.iter().position(|&c| c == name) {
                _ if name == "logAll" => self.enable_all(true),
                Some(index) => self.enabled |= 1 << index,
                None => {
                    all_exist = false;
                    let categories = self.categories.join(", ");
                    self.reason(
                        Status::Warning,
                        &format!("fmi2SetDebugLogging: unknown category \"{name}\"; expected one of {categories}"),
                    );
                }
            }
        }
        all_exist
    }

    #[cold]
    fn write(&self, status: Status, category: &'static str, message: &str) {
        let Some(sink) = &self.sink else { return };
        // Generated names hold no NUL; an empty category would still be better than the NULL that crashes masters.
        let category = CString::new(category).unwrap_or_default();
        let message = printf_safe(message);
        // SAFETY: `Log::new` was promised that the logger can be called. All strings end in NUL and outlive the call.
        // The message is a format without a conversion, so that no further argument is looked for.
        unsafe {
            (sink.logger)(
                sink.environment,
                sink.instance_name.as_ptr(),
                status,
                category.as_ptr(),
                message.as_ptr(),
            );
        }
    }
}

/// The text as a printf format which prints it: `%` is doubled. So is `#`, which encloses variable references in FMI.
fn printf_safe(text: &str) -> CString {
    let text = text.replace('%', "%%").replace('#', "##").replace('\0', "\u{fffd}");
    CString::new(text).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_safe_as_a_printf_format() {
        assert_eq!(printf_safe("100 %n #r1# \0").to_str(), Ok("100 %%n ##r1## \u{fffd}"));
    }
}
