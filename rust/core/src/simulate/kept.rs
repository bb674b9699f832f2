//! What was made from a recording, kept for the next run of the same structure.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// Structures that are kept.
const KEPT: usize = 64;

/// The results made last, by what they were made from.
pub struct Kept<K, V>(Mutex<VecDeque<(K, Arc<V>)>>);

impl<K, V> Kept<K, V> {
    pub const fn new() -> Self {
        Kept(Mutex::new(VecDeque::new()))
    }

    /// The entries, unless another thread looks at them. Never waits: a process that was forked while another thread of its
    /// parent held the lock would wait for ever.
    fn entries(&self) -> Option<MutexGuard<'_, VecDeque<(K, Arc<V>)>>> {
        match self.0.try_lock() {
            Ok(entries) => Some(entries),
            Err(TryLockError::Poisoned(poisoned)) => Some(PoisonError::into_inner(poisoned)),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// The result for `key`: the one that is there, or a new one.
    pub fn of(&self, key: K, make: impl FnOnce(&K) -> V) -> Arc<V>
    where
        K: PartialEq,
    {
        let found = self.entries().and_then(|mut entries| {
            let at = entries.iter().position(|(known, _)| *known == key)?;
            let entry = entries.remove(at)?;
            let value = entry.1.clone();
            entries.push_back(entry);
            Some(value)
        });
        if let Some(found) = found {
            return found;
        }
        let made = Arc::new(make(&key));
        if let Some(mut entries) = self.entries() {
            entries.push_back((key, made.clone()));
            while entries.len() > KEPT {
                entries.pop_front();
            }
        }
        made
    }
}
