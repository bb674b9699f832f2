//! A store of programs made from recordings. A later recording with the same structure uses them.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// Largest number of stored entries of each kind.
pub const KEPT: usize = 64;

/// The content of a lock, if no other thread holds it. The function never waits. A forked process could wait for ever, because a thread of
/// its parent may have held the lock during the fork.
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

    /// Store an entry. The oldest ones are removed until the entries are few and fit.
    pub fn keep(&self, entry: T, fits: impl Fn(&VecDeque<T>) -> bool) {
        let Some(mut entries) = free(&self.0) else { return };
        entries.push_back(entry);
        while entries.len() > KEPT || !entries.is_empty() && !fits(&entries) {
            entries.pop_front();
        }
    }

    /// Number of entries.
    #[cfg(test)]
    pub fn count(&self) -> usize {
        free(&self.0).map_or(0, |entries| entries.len())
    }
}
