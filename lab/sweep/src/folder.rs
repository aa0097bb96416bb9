//! A folder as the storage of a Zarr store, whose files are either complete or absent.

use std::{
    fs,
    hash::{BuildHasher, RandomState},
    io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

use zarrs::storage::{Bytes, OffsetBytesIterator, StorageError, StoreKey, StorePrefix, WritableStorageTraits};

use crate::gzip::{Fault, unpack};

/// Where files are written before they get their name.
pub(crate) const PARTIAL: &str = ".partial";

/// A folder. (The storage of the crate `zarrs_filesystem` writes in place, and remembers every key.)
#[derive(Debug)]
pub(crate) struct Folder {
    root: PathBuf,
    /// A random number. Threads, processes and machines may write to one store: numbers of processes repeat on other machines.
    writer: u64,
    written: AtomicU64,
}

impl Folder {
    pub(crate) fn new(root: &Path) -> Self {
        Self {
            root: root.into(),
            writer: RandomState::new().hash_one(0),
            written: AtomicU64::new(0),
        }
    }

    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.root.join(key)
    }

    /// The content of a file that ends with its checksum.
    pub(crate) fn read(&self, key: &str) -> Result<Vec<u8>, Fault> {
        unpack(&fs::read(self.path(key))?)
    }

    /// Writes a file completely or not at all: under another name first.
    pub(crate) fn write(&self, key: &str, content: &[u8]) -> io::Result<()> {
        let target = self.path(key);
        let path = self.partial();
        fs::create_dir_all(self.path(PARTIAL))?;
        let complete = || {
            // Not flushed to the disk for each chunk: only a power failure needs it, and loses no more than the last chunks.
            fs::write(&path, content)?;
            if let Some(parent) = target.parent() {
                fs::create_dir_all(parent)?;
            }
            fs::rename(&path, &target)
        };
        complete().inspect_err(|_| drop(fs::remove_file(&path)))
    }

    /// A new name for a file that is not complete.
    fn partial(&self) -> PathBuf {
        let number = self.written.fetch_add(1, Ordering::Relaxed);
        self.path(PARTIAL).join(format!("{:016x}-{number}", self.writer))
    }

    /// Removes a folder inside, if it is there.
    pub(crate) fn remove(&self, name: &str) -> io::Result<()> {
        match fs::remove_dir_all(self.path(name)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

impl WritableStorageTraits for Folder {
    fn set(&self, key: &StoreKey, value: Bytes) -> Result<(), StorageError> {
        Ok(self.write(key.as_str(), &value)?)
    }

    fn set_partial_many(&self, _: &StoreKey, _: OffsetBytesIterator) -> Result<(), StorageError> {
        Err(StorageError::Unsupported("files are written as a whole".into()))
    }

    fn erase(&self, key: &StoreKey) -> Result<(), StorageError> {
        Ok(fs::remove_file(self.path(key.as_str()))?)
    }

    fn erase_prefix(&self, prefix: &StorePrefix) -> Result<(), StorageError> {
        Ok(fs::remove_dir_all(self.path(prefix.as_str()))?)
    }

    fn supports_set_partial(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writers_in_one_process_or_in_processes_of_the_same_number_do_not_share_partial_files() {
        let [one, other] = [(); 2].map(|()| Folder::new(Path::new("store")));
        assert_ne!(one.partial(), other.partial());
        assert_ne!(one.partial(), one.partial());
    }
}
