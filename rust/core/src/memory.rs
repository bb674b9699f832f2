//! Allocation of memory whose size the caller decides. If memory is insufficient, the result is the error `Memory`, and the process
//! continues.

use crate::error::{Error, Result};
use crate::interrupt;

/// The number of elements that are written between two checks for a stop request. The first write to a page is slow.
pub const PIECE: usize = 1 << 14;
/// The number of elements between two checks, for elements that own memory.
const SMALL_PIECE: usize = 1 << 10;

/// Return an empty vector with the capacity `n`.
pub fn reserved<T>(n: usize) -> Result<Vec<T>> {
    let mut out = Vec::new();
    more(&mut out, n)?;
    Ok(out)
}

/// Reserve memory for exactly `n` more elements.
pub fn more<T>(out: &mut Vec<T>, n: usize) -> Result<()> {
    let bytes = (out.len() as u128 + n as u128) * size_of::<T>() as u128;
    out.try_reserve_exact(n).map_err(|_| Error::Memory { bytes })
}

/// Return a vector with `n` copies of `value`.
pub fn filled<T: Clone>(n: usize, value: T) -> Result<Vec<T>> {
    let mut out = Vec::new();
    enlarge(&mut out, n, value)?;
    Ok(out)
}

/// Extend `out` to at least `n` elements with copies of `value`.
pub fn enlarge<T: Clone>(out: &mut Vec<T>, n: usize, value: T) -> Result<()> {
    if out.len() < n {
        more(out, n - out.len())?;
        extend(out, n, &value);
    }
    Ok(())
}

fn extend<T: Clone>(out: &mut Vec<T>, n: usize, value: &T) {
    while out.len() < n {
        interrupt::check();
        out.resize((out.len() + PIECE).min(n), value.clone());
    }
}

/// Return `n` copies of `value`. The caller has already checked with [`require`] that enough memory is available: an allocation that fails
/// ends the process.
pub fn copies<T: Copy>(n: usize, value: T) -> Vec<T> {
    let mut out = Vec::with_capacity(n);
    while out.len() < n {
        interrupt::check();
        // A `Copy` value is copied as bytes. A clone would copy a structure field by field.
        out.extend((0..PIECE.min(n - out.len())).map(|_| value));
    }
    out
}

/// Return a copy of `values`, for elements that are slow to clone. The caller has already checked that enough memory is available.
pub fn cloned<T: Clone>(values: &[T]) -> Vec<T> {
    let mut out = Vec::with_capacity(values.len());
    for piece in values.chunks(SMALL_PIECE) {
        interrupt::check();
        out.extend_from_slice(piece);
    }
    out
}

/// Copy `from` to `to`, which has the same length. Copies of at most [`PIECE`] elements do not check for a stop request.
pub fn copy<T: Copy>(from: &[T], to: &mut [T]) {
    for (k, (from, to)) in from.chunks(PIECE).zip(to.chunks_mut(PIECE)).enumerate() {
        if k > 0 {
            interrupt::check();
        }
        to.copy_from_slice(from);
    }
}

/// Set every element to `value`. Arrays of at most [`PIECE`] elements are set without a check for a stop request. Larger arrays have one
/// check before each further piece of [`PIECE`] elements.
pub fn set<T: Copy>(out: &mut [T], value: T) {
    for (k, piece) in out.chunks_mut(PIECE).enumerate() {
        if k > 0 {
            interrupt::check();
        }
        piece.fill(value);
    }
}

/// Return `n` zeros.
pub fn zeros(n: usize) -> Result<Vec<f64>> {
    filled(n, 0.0)
}

/// Return `n` default values, zeros for numbers. For large `n`, the system provides each page of memory when it is first used.
pub fn untouched<T: Clone + Default>(n: usize) -> Result<Vec<T>> {
    reserved::<T>(n)?;
    Ok(vec![T::default(); n])
}

/// Return a copy of `values`.
pub fn copied<T: Copy>(values: &[T]) -> Result<Vec<T>> {
    let mut out = reserved(values.len())?;
    for piece in values.chunks(PIECE) {
        interrupt::check();
        out.extend_from_slice(piece);
    }
    Ok(out)
}

/// Collect an iterator of known length.
pub fn collected<T>(values: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut out = reserved(values.len())?;
    for (k, value) in values.enumerate() {
        if k % PIECE == PIECE - 1 {
            interrupt::check();
        }
        out.push(value);
    }
    Ok(out)
}

/// Reserve memory for `n` more elements if the capacity is too small.
pub fn ensure<T>(out: &mut Vec<T>, n: usize) -> Result<()> {
    if out.capacity() - out.len() < n { more(out, n) } else { Ok(()) }
}

/// Append `values`. If the capacity is too small, it grows by at least half, because many such vectors grow record by record.
pub fn append<T: Copy>(out: &mut Vec<T>, values: &[T]) -> Result<()> {
    if out.capacity() - out.len() < values.len() {
        more(out, values.len().max(out.len() / 2))?;
    }
    out.extend_from_slice(values);
    Ok(())
}

/// Refuse a size, in bytes, that cannot be allocated now. For structures with many small parts, `bytes` estimates their sum.
pub fn require(bytes: usize) -> Result<()> {
    reserved::<u8>(bytes).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interrupt::{Interrupted, Watch, interruptible};
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn what_cannot_be_had_is_an_error_that_says_how_much() {
        let most = usize::MAX / 4;
        let bytes = most as u128 * 8;
        assert_eq!(zeros(most), Err(Error::Memory { bytes }));
        assert_eq!(untouched::<f64>(most), Err(Error::Memory { bytes }));
        assert_eq!(untouched(3), Ok(vec![0.0; 3]));
        assert_eq!(untouched(2), Ok(vec![0_i64; 2]));
        assert_eq!(reserved::<f64>(most).map(|_| ()), Err(Error::Memory { bytes }));
        assert_eq!(require(most * 3), Err(Error::Memory { bytes: most as u128 * 3 }));
        assert_eq!(collected((0..3).map(f64::from)), Ok(vec![0.0, 1.0, 2.0]));
        assert_eq!(copied(&[1, 2]), Ok(vec![1, 2]));
    }

    #[test]
    fn large_memory_is_handled_with_looks_and_small_memory_without() {
        let watched = |work: &mut dyn FnMut()| interruptible(Watch::Flag(Arc::new(AtomicBool::new(true))), work) == Err(Interrupted);
        let (mut small, mut large) = (vec![0.0; PIECE], vec![0.0; PIECE + 1]);
        let (from, names) = (large.clone(), vec![String::new(); PIECE]);
        assert!(!watched(&mut || set(&mut small, 1.0)) && watched(&mut || set(&mut large, 1.0)));
        assert!(!watched(&mut || copy(&from[1..], &mut small)) && watched(&mut || copy(&from, &mut large)));
        assert!(watched(&mut || drop(copies(1, 0.0))) && watched(&mut || drop(cloned(&names))));
        assert!(watched(&mut || assert!(enlarge(&mut small, PIECE + 1, 0.0).is_ok())));
        // Without a source of requests, the work is completed.
        set(&mut large, 2.0);
        assert_eq!((large.as_slice(), copies(PIECE + 1, 2.0)), ([2.0; PIECE + 1].as_slice(), vec![2.0; PIECE + 1]));
        copy(&from, &mut large);
        assert_eq!((large, cloned(&names)), (from, names));
        assert_eq!(enlarge(&mut small, 2, 3.0), Ok(()));
        assert_eq!(small.len(), PIECE);
    }

    #[test]
    fn appending_grows_seldom() {
        let (mut out, mut grown, mut capacity) = (Vec::new(), 0, 0);
        for k in 0..10_000 {
            append(&mut out, &[k, k]).expect("little");
            grown += usize::from(out.capacity() != capacity);
            capacity = out.capacity();
        }
        assert_eq!(out.len(), 20_000);
        assert!(grown < 40, "{grown}");
    }
}
