//! Options of a program that must meet deadlines: priority, memory and processor.

use std::io;

use clap::Args;

use super::failure::Failure;

#[derive(Debug, Args)]
pub(super) struct RealTimeArguments {
    /// Real-time priority (SCHED_FIFO), from 1 to 99
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,

    /// Lock all memory, so that nothing is paged out
    #[arg(long)]
    lock_memory: bool,

    /// Run on this processor only, from 0
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
}

impl RealTimeArguments {
    /// Asks the system for what the user wants.
    pub(super) fn apply(&self) -> Result<(), Failure> {
        if let Some(priority) = self.priority {
            let help = "allow it with `ulimit -r 99`, rtprio in /etc/security/limits.conf, or CAP_SYS_NICE";
            asked(&format!("--priority {priority}"), system::priority(priority), help)?;
        }
        if self.lock_memory {
            let help = "allow it with `ulimit -l unlimited`, memlock in /etc/security/limits.conf, or CAP_IPC_LOCK";
            asked("--lock-memory", system::lock_memory(), help)?;
        }
        if let Some(cpu) = self.cpu {
            let help = "`nproc` prints how many processors there are; the first is 0";
            asked(&format!("--cpu {cpu}"), system::processor(cpu), help)?;
        }
        Ok(())
    }
}

fn asked(option: &str, answer: io::Result<()>, help: &str) -> Result<(), Failure> {
    answer.map_err(|error| Failure::run(format!("{option}: the system refuses: {error}; {help}")))
}

#[cfg(target_os = "linux")]
mod system {
    use std::io;

    use rustix::{mm, thread};
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
        thread_native_id,
    };

    pub fn priority(priority: u8) -> io::Result<()> {
        let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        let value = ThreadPriority::Crossplatform(priority.try_into().map_err(io::Error::other)?);
        set_thread_priority_and_policy(thread_native_id(), value, policy).map_err(io::Error::other)
    }

    pub fn lock_memory() -> io::Result<()> {
        let all = mm::MlockAllFlags::CURRENT | mm::MlockAllFlags::FUTURE;
        Ok(mm::mlockall(all)?)
    }

    pub fn processor(number: usize) -> io::Result<()> {
        if number >= thread::CpuSet::MAX_CPU {
            return Err(io::Error::other("there is no such processor"));
        }
        let mut set = thread::CpuSet::new();
        set.set(number);
        Ok(thread::sched_setaffinity(None, &set)?)
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use std::io;

    pub fn priority<T>(_: T) -> io::Result<()> {
        Err(io::Error::other("this option exists on Linux only"))
    }
    pub use priority as processor;

    pub fn lock_memory() -> io::Result<()> {
        priority(())
    }
}
