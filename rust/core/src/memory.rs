//! Memory of a size that a caller decides: what cannot be had is an error, never the end of the process.

use crate::error::{Error, Result};
use crate::interrupt::look;

/// Elements that are written between two looks whether to stop: the first touch of a page takes long.
const PIECE: usize = 1 << 14;

/// An empty vector with room for `n` elements.
pub fn reserved<T>(n: usize) -> Result<Vec<T>> {
    let mut out = Vec::new();
    more(&mut out, n)?;
    Ok(out)
}

/// Make room for exactly `n` more elements.
pub fn more<T>(out: &mut Vec<T>, n: usize) -> Result<()> {
    let bytes = (out.len() as u128 + n as u128) * size_of::<T>() as u128;
    out.try_reserve_exact(n).map_err(|_| Error::Memory { bytes })
}

/// `n` copies of `value`.
pub fn filled<T: Clone>(n: usize, value: T) -> Result<Vec<T>> {
    let mut out = reserved(n)?;
    while out.len() < n {
        look();
        out.resize((out.len() + PIECE).min(n), value.clone());
    }
    Ok(out)
}

/// `n` zeros.
pub fn zeros(n: usize) -> Result<Vec<f64>> {
    filled(n, 0.0)
}

/// `n` zeros, of which the system hands out pages as they are touched where there are many.
pub fn untouched(n: usize) -> Result<Vec<f64>> {
    reserved::<f64>(n)?;
    Ok(vec![0.0; n])
}

/// A copy.
pub fn copied<T: Copy>(values: &[T]) -> Result<Vec<T>> {
    let mut out = reserved(values.len())?;
    for piece in values.chunks(PIECE) {
        look();
        out.extend_from_slice(piece);
    }
    Ok(out)
}

/// The elements of an iterator that knows how many it has.
pub fn collected<T>(values: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut out = reserved(values.len())?;
    for (k, value) in values.enumerate() {
        if k % PIECE == PIECE - 1 {
            look();
        }
        out.push(value);
    }
    Ok(out)
}

/// Append, growing by half: for what becomes long record by record.
pub fn append<T: Copy>(out: &mut Vec<T>, values: &[T]) -> Result<()> {
    if out.capacity() - out.len() < values.len() {
        more(out, values.len().max(out.len() / 2))?;
    }
    out.extend_from_slice(values);
    Ok(())
}

/// Refuse what needs more than can be had just now. For structures of many small parts: `bytes` is an estimate of their sum.
pub fn require(bytes: usize) -> Result<()> {
    reserved::<u8>(bytes).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_had_is_an_error_that_says_how_much() {
        let most = usize::MAX / 4;
        let bytes = most as u128 * 8;
        assert_eq!(zeros(most), Err(Error::Memory { bytes }));
        assert_eq!(untouched(most), Err(Error::Memory { bytes }));
        assert_eq!(untouched(3), Ok(vec![0.0; 3]));
        assert_eq!(reserved::<f64>(most).map(|_| ()), Err(Error::Memory { bytes }));
        assert_eq!(require(most * 3), Err(Error::Memory { bytes: most as u128 * 3 }));
        assert_eq!(collected((0..3).map(f64::from)), Ok(vec![0.0, 1.0, 2.0]));
        assert_eq!(copied(&[1, 2]), Ok(vec![1, 2]));
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
