//! Long calculations: without the interpreter lock, and ended by Ctrl-C.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
        mpsc::{RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use pyo3::{exceptions::PyRuntimeError, prelude::*};
use vines_model::numerics::stop_thread_with;

/// Time between two looks at the signals.
const LOOK: Duration = Duration::from_millis(25);

/// Stack of the thread of [`wait_apart`], bytes: that of a main thread.
const STACK: usize = 8 << 20;

/// Runs `work` without the interpreter lock, in a thread of its own. A signal ends this call at once, whatever `work` does; `stop` is then true, and
/// the thread ends at its next iteration of a search, or where `work` looks at it.
pub fn wait_apart<T: Send + 'static>(
    py: Python<'_>,
    stop: &Arc<AtomicBool>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    py.detach(|| {
        let (done, is_done) = channel();
        let of_thread = Arc::clone(stop);
        let thread = thread::Builder::new().stack_size(STACK).spawn(move || {
            stop_thread_with(&of_thread);
            // Nobody listens after a signal.
            let _ = done.send(work());
        })?;
        loop {
            match is_done.recv_timeout(LOOK) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals()).inspect_err(|_| {
                    stop.store(true, Relaxed);
                })?,
                Err(RecvTimeoutError::Disconnected) => match thread.join() {
                    Err(panic) => std::panic::resume_unwind(panic),
                    Ok(()) => return Err(PyRuntimeError::new_err("the calculation ended without a result")),
                },
            }
        }
    })
}

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
            match (failure, work.join()) {
                // What the stop left of it, a panic too, is of no use.
                (Some(failure), _) => Err(failure),
                (None, Ok(result)) => Ok(result),
                (None, Err(panic)) => std::panic::resume_unwind(panic),
            }
        })
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
