//! Long calculations: without the interpreter lock, and ended by Ctrl-C.

use std::{
    sync::{
        atomic::{AtomicBool, Ordering::Relaxed},
        mpsc::{RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use pyo3::prelude::*;

/// Time between two looks at the signals.
const LOOK: Duration = Duration::from_millis(25);

/// Runs `work` without the interpreter lock. `look` is called at intervals with it; its error, or that of a signal, sets `stop`, upon
/// which `work` must end soon.
pub fn wait<T: Send>(
    py: Python<'_>,
    stop: &AtomicBool,
    look: impl Fn(Python<'_>) -> PyResult<()> + Sync,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    py.detach(|| {
        thread::scope(|scope| {
            let (done, is_done) = channel();
            let work = scope.spawn(move || {
                let result = work();
                // Nobody listens after a failure of this function.
                let _ = done.send(());
                result
            });
            let mut failure = None;
            while let Err(RecvTimeoutError::Timeout) = is_done.recv_timeout(LOOK) {
                let looked = Python::attach(|py| py.check_signals().and_then(|()| look(py)));
                if let Err(error) = looked {
                    stop.store(true, Relaxed);
                    failure.get_or_insert(error);
                }
            }
            let result = work.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            failure.map_or(Ok(result), Err)
        })
    })
}
