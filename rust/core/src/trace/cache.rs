//! A cache of programs made from recordings. A later recording with the same structure uses the stored program.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// The maximum number of stored entries of each kind.
pub const KEPT: usize = 64;

/// Return the content of a lock, or `None` if another thread holds the lock. The function never waits. A waiting function could wait for
/// ever in a forked process, if another thread of the parent process held the lock during the fork.
pub fn free<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    match mutex.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(poisoned)) => Some(PoisonError::into_inner(poisoned)),
        Err(TryLockError::WouldBlock) => None,
    }
}

/// A store of the most recently used entries.
pub struct Cache<T>(Mutex<VecDeque<T>>);

impl<T> Default for Cache<T> {
    fn default() -> Self {
        Cache(Mutex::default())
    }
}

impl<T: Clone> Cache<T> {
    pub const fn new() -> Self {
        Cache(Mutex::new(VecDeque::new()))
    }

    /// Return the matching entry; `None` if there is none, or if another thread holds the lock.
    pub fn find(&self, is: impl Fn(&T) -> bool) -> Option<T> {
        let mut entries = free(&self.0)?;
        let at = entries.iter().position(is)?;
        let entry = entries.remove(at)?;
        entries.push_back(entry.clone());
        Some(entry)
    }

    /// Store an entry. Remove the oldest entries until at most [`KEPT`] remain and `fits` is true. If another thread holds the lock,
    /// nothing is stored.
    pub fn keep(&self, entry: T, fits: impl Fn(&VecDeque<T>) -> bool) {
        let Some(mut entries) = free(&self.0) else { return };
        entries.push_back(entry);
        while entries.len() > KEPT || !entries.is_empty() && !fits(&entries) {
            entries.pop_front();
        }
    }

    /// The number of entries.
    #[cfg(test)]
    pub fn count(&self) -> usize {
        free(&self.0).map_or(0, |entries| entries.len())
    }
}
