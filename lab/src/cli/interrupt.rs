//! Ctrl-C and SIGTERM while a rig is driven: the drive becomes zero and the session ends before the program does.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use super::failure::{Failure, INTERRUPTED};

/// A flag that a signal sets. A second signal ends the program at once.
pub(super) fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(Arc::clone(flag));
    }
    let flag = Arc::clone(FLAG.get_or_init(Arc::default));
    let signal = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if signal.swap(true, Ordering::Relaxed) {
            process::exit(INTERRUPTED.into());
        }
    })
    .map_err(|error| Failure::run(format!("cannot wait for Ctrl-C: {error}")))?;
    Ok(flag)
}
