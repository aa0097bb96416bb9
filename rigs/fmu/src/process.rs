//! What an FMU shares with the program that loads it: signals, stdout, the working folder and the end of the process.
//!
//! An FMU is foreign code in this process. It may replace signal handlers, print, change the working folder, and hang. A program that loads
//! FMUs calls [`keep_stdout`] and [`catch_signals`] before, and can end without the FMU ([`end`]).

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicI32, AtomicU32, AtomicU64, Ordering::SeqCst};
use std::sync::{Mutex, MutexGuard, PoisonError};

use libc::c_int;
use tempfile::TempDir;

/// A signal that ends a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal(c_int);

/// Those that are caught, with their names.
const SIGNALS: &[(c_int, &str)] = &[
    (libc::SIGINT, "SIGINT"),
    (libc::SIGTERM, "SIGTERM"),
    #[cfg(unix)]
    (libc::SIGHUP, "SIGHUP"),
];

impl Signal {
    /// The exit code of a program that it ends: 128 and its number, as shells report it.
    #[must_use]
    pub fn exit_code(self) -> u8 {
        128 + self.0 as u8
    }
}

impl Display for Signal {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let name = SIGNALS.iter().find(|(number, _)| *number == self.0);
        f.write_str(name.map_or("a signal", |(_, name)| name))
    }
}

/// Number of the first signal, 0 before it, and how many have arrived.
static FIRST: AtomicI32 = AtomicI32::new(0);
static ARRIVED: AtomicU32 = AtomicU32::new(0);

extern "C" fn note(signal: c_int) {
    let _ = FIRST.compare_exchange(0, signal, SeqCst, SeqCst);
    ARRIVED.fetch_add(1, SeqCst);
}

/// Catches SIGINT, SIGTERM and, unless it was ignored at the first call, SIGHUP. A program calls this again at intervals: a library that it has
/// loaded may have replaced the handlers, as an embedded Python does.
pub fn catch_signals() {
    let handler = note as extern "C" fn(c_int) as *const () as libc::sighandler_t;
    for &(signal, name) in SIGNALS {
        if !(name == "SIGHUP" && ignores_hang_up()) {
            // SAFETY: the handler only writes to atomics, which a handler may do at any time.
            unsafe { libc::signal(signal, handler) };
        }
    }
}

/// Whether SIGHUP was ignored at the first call, as `nohup` does.
fn ignores_hang_up() -> bool {
    #[cfg(unix)]
    {
        static IGNORES: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
        *IGNORES.get_or_init(|| {
            // SAFETY: ignores the signal until the next line.
            let before = unsafe { libc::signal(libc::SIGHUP, libc::SIG_IGN) };
            // SAFETY: restores what was there.
            unsafe { libc::signal(libc::SIGHUP, before) };
            before == libc::SIG_IGN
        })
    }
    #[cfg(not(unix))]
    false
}

/// The first signal that has arrived, and how many have.
#[must_use]
pub fn signal() -> Option<(Signal, u32)> {
    let first = FIRST.load(SeqCst);
    (first != 0).then(|| (Signal(first), ARRIVED.load(SeqCst)))
}

/// Gives the program a stdout of its own. From now on, what an FMU or another library prints goes to stderr.
///
/// # Errors
/// A process without stdout, or without a descriptor to spare.
pub fn keep_stdout() -> io::Result<File> {
    #[cfg(unix)]
    let own = std::os::fd::AsFd::as_fd(&io::stdout()).try_clone_to_owned()?;
    #[cfg(windows)]
    let own = std::os::windows::io::AsHandle::as_handle(&io::stdout()).try_clone_to_owned()?;
    // SAFETY: both are the numbers that C gives to its standard streams; `own` keeps what was stdout open.
    match unsafe { libc::dup2(2, 1) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(own.into()),
    }
}

// What is only of use while this process runs.

type Removal = Box<dyn FnOnce() + Send>;
static CLEANUPS: Mutex<BTreeMap<u64, Removal>> = Mutex::new(BTreeMap::new());

fn cleanups() -> MutexGuard<'static, BTreeMap<u64, Removal>> {
    CLEANUPS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes what only this process uses, such as a temporary folder, when it is dropped and when the process ends by [`end`].
#[derive(Debug)]
pub struct Cleanup(u64);

impl Cleanup {
    /// `remove` must not wait for anything.
    #[must_use]
    pub fn new(remove: impl FnOnce() + Send + 'static) -> Self {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, SeqCst);
        cleanups().insert(number, Box::new(remove));
        Self(number)
    }
}

impl Drop for Cleanup {
    fn drop(&mut self) {
        let remove = cleanups().remove(&self.0);
        if let Some(remove) = remove {
            remove();
        }
    }
}

/// A temporary folder that is removed when it is dropped and when the process ends by [`end`].
#[derive(Debug)]
pub struct TemporaryFolder {
    path: PathBuf,
    _cleanup: Cleanup,
}

impl TemporaryFolder {
    /// The folder `folder`, whose path becomes absolute: an FMU may change the working folder.
    pub fn new(folder: TempDir) -> Self {
        let folder = folder.keep();
        let path = std::path::absolute(&folder).unwrap_or(folder);
        let removed = path.clone();
        let _cleanup = Cleanup::new(move || {
            // Best effort: an old folder does no harm.
            let _ = std::fs::remove_dir_all(removed);
        });
        Self { path, _cleanup }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Ends the process at once, whatever its threads and its FMUs do: the functions that these have registered for an exit are not called.
pub fn end(code: u8) -> ! {
    let all = std::mem::take(&mut *cleanups());
    all.into_values().rev().for_each(|remove| remove());
    // SAFETY: ends the process; there is no state that anybody could see afterwards.
    unsafe { libc::_exit(code.into()) }
}

/// The working folder, which an FMU may change: dropping this restores it.
pub(crate) struct WorkingFolder(Option<PathBuf>);

impl WorkingFolder {
    pub fn new() -> Self {
        Self(std::env::current_dir().ok())
    }

    pub fn restore(&self) {
        // One that has been removed cannot be restored.
        let _ = self.0.as_ref().map(std::env::set_current_dir);
    }
}

impl Drop for WorkingFolder {
    fn drop(&mut self) {
        self.restore();
    }
}
