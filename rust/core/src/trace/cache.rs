//! A store of the programs made from recordings, for the next recording with the same structure.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// Entries of every kind that are kept at most.
pub const KEPT: usize = 64;

/// The content of a lock, if no other thread holds it. It never waits. Otherwise a process could wait for ever, if it was forked while
/// another thread of its parent held the lock.
pub fn free<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    match mutex.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(poisoned)) => Some(PoisonError::into_inner(poisoned)),
        Err(TryLockError::WouldBlock) => None,
    }
}

/// The entries used last.
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

    /// The matching entry, if there is one.
    pub fn find(&self, is: impl Fn(&T) -> bool) -> Option<T> {
        let mut entries = free(&self.0)?;
        let at = entries.iter().position(is)?;
        let entry = entries.remove(at)?;
        entries.push_back(entry.clone());
        Some(entry)
    }

    /// Keep an entry; the oldest ones go until there are few and they fit.
    pub fn keep(&self, entry: T, fits: impl Fn(&VecDeque<T>) -> bool) {
        let Some(mut entries) = free(&self.0) else { return };
        entries.push_back(entry);
        while entries.len() > KEPT || !entries.is_empty() && !fits(&entries) {
            entries.pop_front();
        }
    }

    /// How many there are.
    #[cfg(test)]
    pub fn count(&self) -> usize {
        free(&self.0).map_or(0, |entries| entries.len())
    }
}
