//! Long calculations: without the interpreter lock, and ended by Ctrl-C.

use std::{
    sync::{
        atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
        mpsc::{RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use pyo3::{exceptions::PyRuntimeError, prelude::*};

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

/// As [`wait`] for work that owns all it needs: after a signal it is left to its thread if it does not end at once.
pub fn may_leave<T: Send + 'static>(
    py: Python<'_>,
    stop: &AtomicBool,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    py.detach(|| {
        let (done, is_done) = channel();
        // Nobody listens after a signal.
        let thread = thread::spawn(move || done.send(work()).unwrap_or_default());
        loop {
            match is_done.recv_timeout(LOOK) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Disconnected) => match thread.join() {
                    Err(panic) => std::panic::resume_unwind(panic),
                    Ok(()) => unreachable!("the thread sends its result"),
                },
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(error) = Python::attach(|py| py.check_signals()) {
                        stop.store(true, Relaxed);
                        // Mostly it ends at once. Then no core is busy for nothing.
                        let _ = is_done.recv_timeout(2 * LOOK);
                        return Err(error);
                    }
                }
            }
        }
    })
}

/// Refuses in a fork of a process that has used the threads of the cores: a fork has none of them, and would wait for ever.
pub fn own_threads() -> PyResult<()> {
    static OWNER: AtomicU32 = AtomicU32::new(0);
    let this = std::process::id();
    match OWNER.compare_exchange(0, this, Relaxed, Relaxed) {
        Err(owner) if owner != this => Err(PyRuntimeError::new_err(format!(
            "process {this} was forked from process {owner} after vines had started threads there, and a fork has no threads; start \
             processes with multiprocessing.get_context(\"spawn\"), or fork before the first Batch.advance or sweep"
        ))),
        _ => Ok(()),
    }
}
