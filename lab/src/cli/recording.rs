//! `--record`: the samples of an experiment, written while it runs.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use vines::knowledge::Target;
use vines::record::{Sample, headings, write_row};
use vines::rig::Rig;
use vines::{FileError, create_folder_of};

use super::tap::Tap;

/// Time between two writes. What was recorded since the last one is lost if the process is killed.
const WRITE_INTERVAL: Duration = Duration::from_millis(100);
/// Longest text of a write, about: a simulation may be faster than its recording.
const BLOCK: usize = 1 << 20;

/// A file that is being recorded. The experiment never waits for it: a thread of its own formats and writes the samples.
pub(super) struct Recording {
    path: PathBuf,
    /// Whether the file is new.
    is_new: bool,
    sender: Sender<Sample>,
    thread: JoinHandle<io::Result<bool>>,
}

impl Recording {
    /// Opens the file for the channels of `target`. It stays as it is until the first sample.
    pub(super) fn open(path: PathBuf, target: &Target) -> Result<Self, FileError> {
        let is_new = !path.exists();
        let open = || -> io::Result<File> {
            create_folder_of(&path)?;
            let file = OpenOptions::new().create(true).append(true).open(&path)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => Err(io::Error::other("another run is recording to it")),
                // Not every file has a lock.
                _ => Ok(file),
            }
        };
        let file = open().map_err(FileError::at(&path))?;
        let (sender, receiver) = channel();
        let headings = headings(target);
        let thread = thread::spawn(move || write(file, &receiver, &headings));
        Ok(Self { path, is_new, sender, thread })
    }

    /// The rig, with its samples recorded.
    pub(super) fn rig(&self, rig: Box<dyn Rig>) -> Box<dyn Rig> {
        let sender = self.sender.clone();
        Tap::around(rig, move |sample, _| {
            // After a failure of the thread, which `finish` returns, nobody receives.
            let _ = sender.send(sample);
        })
    }

    /// The file, if there is anything in it. The rig must have been dropped.
    pub(super) fn finish(self) -> Result<Option<PathBuf>, FileError> {
        drop(self.sender);
        let written = self
            .thread
            .join()
            .unwrap_or_else(|_| Err(io::Error::other("its thread has panicked")));
        match written.map_err(FileError::at(&self.path))? {
            true => Ok(Some(self.path)),
            false => {
                if self.is_new {
                    // An empty file does no harm.
                    let _ = std::fs::remove_file(&self.path);
                }
                Ok(None)
            }
        }
    }
}

/// Writes whole rows at intervals, until there is no sender. Returns whether there were any.
fn write(mut file: File, samples: &Receiver<Sample>, headings: &str) -> io::Result<bool> {
    let mut has_begun = false;
    loop {
        let mut rows = String::new();
        let ended = loop {
            match samples.try_recv() {
                Ok(sample) if rows.len() < BLOCK => write_row(&mut rows, &sample),
                Ok(sample) => {
                    write_row(&mut rows, &sample);
                    break false;
                }
                Err(error) => break error == TryRecvError::Disconnected,
            }
        };
        if !rows.is_empty() {
            if !has_begun {
                if file.metadata()?.is_file() {
                    file.set_len(0)?;
                }
                rows.insert_str(0, headings);
                has_begun = true;
            }
            file.write_all(rows.as_bytes())?;
        }
        if ended {
            return Ok(has_begun);
        }
        if rows.len() < BLOCK {
            thread::sleep(WRITE_INTERVAL);
        }
    }
}
