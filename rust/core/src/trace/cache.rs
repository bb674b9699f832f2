//! A cache of the most recently used entries, such as programs of recordings. A later recording that matches a stored entry uses its
//! program.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// The maximum number of entries in a cache.
pub const CAPACITY: usize = 64;

/// Return the content of a lock, or `None` if another thread holds the lock. The function never waits. In a forked process, the lock may
/// remain locked for ever, because another thread of the parent process held it during the fork.
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
        recent(&mut *free(&self.0)?, is)
    }

    /// Store an entry. Remove the least recently used entries until at most [`CAPACITY`] remain and `fits` is true, or until none remains.
    /// If another thread holds the lock, nothing is stored.
    pub fn store(&self, entry: T, fits: impl Fn(&VecDeque<T>) -> bool) {
        if let Some(mut entries) = free(&self.0) {
            add(&mut entries, entry, fits);
        }
    }

    /// Return the matching entry. If no entry matches, store the entry that `make` returns, with the limits of [`Cache::store`]. This
    /// function waits for the lock. So use it only for a cache that belongs to one call and ends with this call.
    pub fn find_or_store(&self, is: impl Fn(&T) -> bool, make: impl FnOnce() -> T, fits: impl Fn(&VecDeque<T>) -> bool) -> T {
        let mut entries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        recent(&mut entries, is).unwrap_or_else(|| {
            let entry = make();
            add(&mut entries, entry.clone(), fits);
            entry
        })
    }

    /// The number of entries.
    #[cfg(test)]
    pub fn count(&self) -> usize {
        free(&self.0).map_or(0, |entries| entries.len())
    }
}

/// A value that is made on first use. No thread waits for another, so two threads may both make it.
pub struct MadeOnce<T>(Mutex<Option<Arc<T>>>);

impl<T> Default for MadeOnce<T> {
    fn default() -> Self {
        MadeOnce(Mutex::default())
    }
}

impl<T> MadeOnce<T> {
    /// Return the value; `None` if it is not made yet, or if another thread holds the lock.
    pub fn known(&self) -> Option<Arc<T>> {
        free(&self.0)?.clone()
    }

    /// Return the value, and make it if it is not known.
    pub fn get(&self, make: impl FnOnce() -> T) -> Arc<T> {
        self.known().unwrap_or_else(|| {
            let made = Arc::new(make());
            if let Some(mut stored) = free(&self.0) {
                *stored = Some(made.clone());
            }
            made
        })
    }
}

/// Return the matching entry, and move it to the end, which is the place of the most recently used entry.
fn recent<T: Clone>(entries: &mut VecDeque<T>, is: impl Fn(&T) -> bool) -> Option<T> {
    let entry = entries.iter().position(is).and_then(|at| entries.remove(at))?;
    entries.push_back(entry.clone());
    Some(entry)
}

/// Add an entry. Remove the least recently used entries until at most [`CAPACITY`] remain and `fits` is true, or until none remains.
fn add<T>(entries: &mut VecDeque<T>, entry: T, fits: impl Fn(&VecDeque<T>) -> bool) {
    entries.push_back(entry);
    while entries.len() > CAPACITY || !entries.is_empty() && !fits(entries) {
        entries.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_cache_stores_the_entries_that_were_used_last() {
        let (cache, made) = (Cache::new(), Cell::new(0));
        let make = |k: usize| {
            made.set(made.get() + 1);
            (k, made.get())
        };
        let find = |k: usize| cache.find_or_store(|&(known, _)| known == k, || make(k), |_| true).1;
        assert_eq!(find(0), find(0), "the second call finds the entry");
        assert_eq!((1..CAPACITY).map(find).max(), Some(CAPACITY), "each other entry is made");
        find(0);
        find(CAPACITY);
        assert_eq!(cache.count(), CAPACITY);
        assert!(cache.find(|&(known, _)| known == 0).is_some(), "it was used later than entry 1");
        assert!(cache.find(|&(known, _)| known == 1).is_none(), "it is the oldest entry");
        cache.find_or_store(|_| false, || (CAPACITY + 1, 0), |entries| entries.len() < 3);
        assert_eq!(cache.count(), 2);
    }
}
