//! How every command ends within two seconds of Ctrl-C (SIGINT), SIGTERM or SIGHUP.
//!
//! One thread waits for a signal. A command that has something to end (a driven rig, a server, files that are being written) holds an
//! [`Orderly`]: it looks at the flag of [`stop_flag`], and ends by itself with what it has. The thread ends any other command at once. If an orderly
//! command has not ended after [`ORDERLY_END`], something does not answer, such as an FMU or a device. The thread then commands a drive of zero itself,
//! unless it is the rig that does not answer, says whether it could, and ends the program.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::mpsc::channel;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use vines::fmu::process::{self, Signal};
use vines::rig::{Drive, GroundTruth, Rig, RigError, Sensors};

/// Time between two looks for a signal.
const LOOK: Duration = Duration::from_millis(20);
/// Time that an orderly command has for its end, and time for the thread's own drive of zero: together below two seconds on a busy machine, too.
const ORDERLY_END: Duration = Duration::from_millis(1000);
const LAST: Duration = Duration::from_millis(400);

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static ORDERLY: AtomicUsize = AtomicUsize::new(0);
static RIG: Mutex<Option<Brake>> = Mutex::new(None);

/// Begins to wait for signals.
pub(super) fn start() {
    process::catch_signals();
    // Without a thread the system ends the program, as it does without a handler; a program that cannot start one will not come far.
    let _ = thread::Builder::new().name("signals".into()).spawn(wait);
}

/// A flag that a signal sets: a driven rig stops, a server ends.
pub(super) fn stop_flag() -> Arc<AtomicBool> {
    Arc::clone(&STOP)
}

/// The signal that has arrived.
pub(super) fn arrived() -> Option<Signal> {
    process::signal().map(|(signal, _)| signal)
}

/// While it exists, the command ends by itself after a signal.
pub(super) struct Orderly(());

impl Orderly {
    pub(super) fn new() -> Self {
        ORDERLY.fetch_add(1, SeqCst);
        Self(())
    }
}

impl Drop for Orderly {
    fn drop(&mut self) {
        ORDERLY.fetch_sub(1, SeqCst);
    }
}

fn wait() {
    let first = loop {
        thread::sleep(LOOK);
        process::catch_signals();
        if let Some((signal, _)) = process::signal() {
            break signal;
        }
    };
    STOP.store(true, SeqCst);
    if ORDERLY.load(SeqCst) > 0 {
        let began = Instant::now();
        // A second signal ends the program at once.
        while began.elapsed() < ORDERLY_END && process::signal().is_none_or(|(_, count)| count == 1) {
            thread::sleep(LOOK);
        }
    }
    super::say(format_args!("error: {}", ended(first)));
    process::end(first.exit_code());
}

/// Commands a drive of zero, unless the rig has it. Returns in words what has become of it; nothing if only a simulation was driven.
fn zeroed() -> String {
    let Some(brake) = lock(&RIG).clone() else {
        return String::new();
    };
    let (done, is_done) = channel();
    thread::spawn(move || done.send(brake.zero()));
    let answer = is_done.recv_timeout(LAST);
    match answer.unwrap_or_else(|_| Err("the rig does not answer".into())) {
        Ok(()) => "; the drive is zero".into(),
        Err(reason) => format!("; zero could not be commanded, because {reason}: switch the drive off at the rig"),
    }
}

/// After the end of a command upon a signal: whether the drive is zero, in words.
pub(super) fn ended(signal: Signal) -> String {
    format!("interrupted by {signal}{}", zeroed())
}

// A rig that the thread can reach.

/// The last drive that a rig has got; `None`: it has failed.
type Last = Option<Drive>;

/// A rig that is not a simulation in this program, and that [`zeroed`] can reach.
struct Reachable<R> {
    rig: Arc<Mutex<R>>,
    last: Arc<Mutex<Last>>,
}

/// The other end of a [`Reachable`] rig.
#[derive(Clone)]
struct Brake {
    rig: Weak<Mutex<dyn Rig + Send>>,
    last: Arc<Mutex<Last>>,
    sample_time: f64,
}

fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes a rig reachable for a drive of zero upon a signal. `sample_time` in s.
pub(super) fn reachable(rig: impl Rig + Send + 'static, sample_time: f64) -> Box<dyn Rig> {
    let (rig, last) = (Arc::new(Mutex::new(rig)), Arc::new(Mutex::new(Some(Drive::default()))));
    let weak = Arc::downgrade(&rig);
    *lock(&RIG) = Some(Brake { rig: weak, last: Arc::clone(&last), sample_time });
    Box::new(Reachable { rig, last })
}

impl<R: Rig> Rig for Reachable<R> {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        lock(&self.rig).sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let result = lock(&self.rig).advance(drive, step);
        *lock(&self.last) = result.is_ok().then_some(drive);
        result
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        lock(&self.rig).ground_truth()
    }
}

impl Brake {
    /// Commands zero, as the last command was given. A zero counts when the rig has answered.
    fn zero(self) -> Result<(), String> {
        let last = *lock(&self.last);
        let is_off = last.is_some_and(Drive::is_off);
        let Some(rig) = self.rig.upgrade() else {
            return if is_off {
                Ok(())
            } else {
                Err("the rig has failed".into())
            };
        };
        // A call that never returns holds the lock, and then the caller does not wait for this.
        let mut rig = lock(&rig);
        let is_held = last.is_some_and(|drive| drive.is_held);
        let commanded = match is_off {
            true => Ok(()),
            false => rig.advance(Drive { is_held, ..Drive::default() }, self.sample_time),
        };
        commanded
            .and_then(|()| rig.sense())
            .map(drop)
            .map_err(|error| error.to_string())
    }
}
