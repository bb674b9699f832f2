//! Vectors of equal length, stored coordinate by coordinate: the same coordinate of all vectors is contiguous in memory. So one SIMD
//! instruction acts on several vectors. Every number has the bits of a loop over single vectors, because the order of each sum is that of
//! the coordinates, and no multiply-add is fused.

use crate::scalar::{GenericKernel, Real, run_lanes};
use std::ops::{Index, IndexMut};

/// The number of vectors is rounded up to a multiple of the most lanes.
const LANES: usize = 8;

#[derive(Debug, Clone)]
pub struct Columns {
    n: usize,
    width: usize,
    /// Coordinate `j` of vector `i` is entry `j width + i`.
    entries: Vec<f64>,
    /// Memory for all vectors.
    work: Vec<f64>,
}

impl Columns {
    /// Allocate `count` vectors with `n` coordinates, which are zero.
    pub fn new(n: usize, count: usize) -> Self {
        let width = count.next_multiple_of(LANES);
        let [entries, work] = [0; 2].map(|_| vec![0.0; n * width]);
        Columns { n, width, entries, work }
    }

    /// The number of coordinates.
    pub fn n(&self) -> usize {
        self.n
    }

    /// The number of vectors, with those that fill the last lanes.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Coordinate `j` of all vectors.
    pub fn coordinate(&self, j: usize) -> &[f64] {
        &self.entries[j * self.width..(j + 1) * self.width]
    }

    /// Coordinate `j` of all vectors, mutable.
    pub fn coordinate_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.entries[j * self.width..(j + 1) * self.width]
    }

    /// The coordinates of vector `i` from `from` on.
    #[inline]
    pub fn vector(&self, i: usize, from: usize) -> impl Iterator<Item = f64> + '_ {
        assert!(i < self.width);
        self.entries.get(from * self.width + i..).unwrap_or_default().iter().step_by(self.width).copied()
    }

    /// Set all coordinates of vector `i` to zero.
    pub fn clear(&mut self, i: usize) {
        (0..self.n).for_each(|j| self[(j, i)] = 0.0);
    }

    /// Copy the first vectors of `other`, which has the same coordinates, and set the others to zero.
    pub fn start(&mut self, other: &Columns) {
        for (to, from) in self.entries.chunks_exact_mut(self.width).zip(other.entries.chunks_exact(other.width)) {
            let (first, others) = to.split_at_mut(from.len().min(to.len()));
            first.copy_from_slice(&from[..first.len()]);
            others.fill(0.0);
        }
    }

    /// Write the scalar products of all vectors with `x` to `out`, both from coordinate `from` on.
    pub fn products(&self, from: usize, x: &[f64], out: &mut [f64]) {
        let entries = &self.entries[from * self.width..];
        run_lanes(Products { entries, width: self.width, x: &x[from..self.n], out });
    }

    /// Reflect the coordinates from `from` on by `I - beta w w'`.
    pub fn reflect(&mut self, from: usize, w: &[f64], beta: f64) {
        let entries = &mut self.entries[from * self.width..(from + w.len()) * self.width];
        run_lanes(Reflection { entries, width: self.width, w, beta });
    }

    /// Rotate the coordinates `at` and `at + 1` by the angle with the cosine `c` and the sine `s`.
    pub fn rotate(&mut self, at: usize, c: f64, s: f64) {
        let (first, second) = self.entries[at * self.width..(at + 2) * self.width].split_at_mut(self.width);
        run_lanes(Rotation { first, second, c, s });
    }

    /// Replace the coordinates from `from` on by their scalar products with the vectors `v(j)`, one per coordinate.
    pub fn turn<'a>(&mut self, from: usize, v: impl Fn(usize) -> &'a [f64]) {
        let Columns { n, width, entries, work } = self;
        let (old, new) = (&mut work[from * *width..], &mut entries[from * *width..]);
        old.copy_from_slice(new);
        for (j, out) in new.chunks_exact_mut(*width).enumerate() {
            run_lanes(Products { entries: old, width: *width, x: &v(j)[..*n - from], out });
        }
    }
}

impl Index<(usize, usize)> for Columns {
    type Output = f64;
    /// Coordinate `j` of vector `i`.
    #[inline]
    fn index(&self, (j, i): (usize, usize)) -> &f64 {
        &self.entries[j * self.width + i]
    }
}

impl IndexMut<(usize, usize)> for Columns {
    #[inline]
    fn index_mut(&mut self, (j, i): (usize, usize)) -> &mut f64 {
        &mut self.entries[j * self.width + i]
    }
}

/// The scalar products of all vectors with `x`.
struct Products<'a> {
    entries: &'a [f64],
    width: usize,
    x: &'a [f64],
    out: &'a mut [f64],
}

impl GenericKernel for Products<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let Products { entries, width, x, out } = self;
        for (block, out) in out[..width].chunks_exact_mut(S::LANES).enumerate() {
            product::<S>(entries, width, x, block * S::LANES).store(out);
        }
    }
}

/// The scalar products of the vectors from `at` on with `x`.
#[inline(always)]
fn product<S: Real>(entries: &[f64], width: usize, x: &[f64], at: usize) -> S {
    let mut terms = entries.chunks_exact(width).zip(x);
    let Some((first, x)) = terms.next() else { return S::zero() };
    terms.fold(S::load(&first[at..]) * S::splat(*x), |sum, (row, x)| sum + S::load(&row[at..]) * S::splat(*x))
}

/// A reflection of all vectors.
struct Reflection<'a> {
    entries: &'a mut [f64],
    width: usize,
    w: &'a [f64],
    beta: f64,
}

impl GenericKernel for Reflection<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let Reflection { entries, width, w, beta } = self;
        for at in (0..width).step_by(S::LANES) {
            let s = S::splat(-beta) * product::<S>(entries, width, w, at);
            for (row, w) in entries.chunks_exact_mut(width).zip(w) {
                let row = &mut row[at..];
                (S::load(row) + s * S::splat(*w)).store(row);
            }
        }
    }
}

/// A rotation of two coordinates of all vectors.
struct Rotation<'a> {
    first: &'a mut [f64],
    second: &'a mut [f64],
    c: f64,
    s: f64,
}

impl GenericKernel for Rotation<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let (c, s) = (S::splat(self.c), S::splat(self.s));
        for (first, second) in self.first.chunks_exact_mut(S::LANES).zip(self.second.chunks_exact_mut(S::LANES)) {
            let (x, y) = (S::load(first), S::load(second));
            (c * x + s * y).store(first);
            (c * y - s * x).store(second);
        }
    }
}
