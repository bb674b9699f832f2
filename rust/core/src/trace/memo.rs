//! A hash map from keys to indices, for example of recorded operations.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A multiplicative hash (Knuth). It suffices because the keys are small and no adversary chooses them.
#[derive(Default)]
pub struct Multiplicative(u64);

impl Hasher for Multiplicative {
    /// The upper bits of the product depend on all bits of the keys. A hash map selects its buckets by the lower bits of the hash.
    #[inline]
    fn finish(&self) -> u64 {
        self.0.rotate_left(26)
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }
    #[inline]
    fn write_u64(&mut self, x: u64) {
        self.0 = (self.0.rotate_left(5) ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    #[inline]
    fn write_u32(&mut self, x: u32) {
        self.write_u64(u64::from(x));
    }
    #[inline]
    fn write_isize(&mut self, x: isize) {
        self.write_u64(x as u64);
    }
}

/// Maps each known key to an index.
pub type Memo<K> = HashMap<K, u32, BuildHasherDefault<Multiplicative>>;
