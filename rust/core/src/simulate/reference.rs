//! The desired motion inside a loop: one for all lanes, or one per lane.

use crate::motion::{Motion, Table, sample_apart};
use crate::scalar::{Real, spread};

/// Where a loop's `[q_d, v_d, a_d]` comes from.
pub struct Reference<'a, S: Real> {
    /// A motion sampled in advance, read in place.
    table: Option<&'a Table>,
    /// One motion, or one per lane.
    motions: Vec<&'a Motion>,
    /// The sample of one motion, `(3 n,)`.
    one: Vec<S::One>,
    /// The samples of all lanes, `(lanes, 3 n)`.
    all: Vec<f64>,
}

impl<'a, S: Real> Reference<'a, S> {
    /// The motions of the lanes; shared where they are one and the same.
    pub fn new(mut motions: Vec<&'a Motion>) -> Self {
        let first = motions[0];
        if motions.iter().all(|&m| std::ptr::eq(m, first)) {
            motions.truncate(1);
        }
        let table = match first {
            Motion::Table(table) if motions.len() == 1 => Some(table),
            _ => None,
        };
        let width = 3 * first.dof();
        let one = vec![S::One::zero(); width];
        let all = vec![0.0; if motions.len() > 1 { width * motions.len() } else { 0 }];
        Reference { table, motions, one, all }
    }

    /// Whether one motion serves all lanes.
    pub fn is_shared(&self) -> bool {
        self.motions.len() == 1
    }

    /// The sample of the one motion of all lanes, by value: what a call can't reach may live in registers.
    #[inline(always)]
    fn sample_shared<const D: usize>(&mut self, t: f64) -> [f64; D] {
        if let Some(row) = self.table.and_then(|table| table.knot(t)).and_then(|row| row.first_chunk()) {
            return *row;
        }
        sample_apart(self.motions[0], t, &mut self.one);
        self.one.first_chunk().map_or([f64::NAN; D], |row| row.map(|x| x.lane(0)))
    }

    #[inline(never)]
    fn sample_each(&mut self, t: f64) {
        let width = self.all.len() / self.motions.len();
        for (motion, row) in self.motions.iter().zip(self.all.chunks_exact_mut(width)) {
            sample_apart(motion, t, row);
        }
    }
}

/// What a loop is told of its desired motion at one instant.
pub trait Desired<S: Real>: Clone {
    /// `[q_d, v_d, a_d]`, `(3 n,)`
    type Lanes: AsRef<[S]>;
    fn sample(&mut self, reference: &mut Reference<S>, t: f64);
    fn lanes(&self) -> Self::Lanes;
}

/// One motion for all lanes: numbers, spread over the lanes where they are used.
#[derive(Clone, Copy)]
pub struct Shared<const D: usize>(pub [f64; D]);

impl<S: Real, const D: usize> Desired<S> for Shared<D> {
    type Lanes = [S; D];
    #[inline(always)]
    fn sample(&mut self, reference: &mut Reference<S>, t: f64) {
        self.0 = reference.sample_shared(t);
    }
    #[inline(always)]
    fn lanes(&self) -> [S; D] {
        spread(&self.0)
    }
}

/// Whatever the lanes share or not.
impl<S: Real, const D: usize> Desired<S> for [S; D] {
    type Lanes = [S; D];
    #[inline(always)]
    fn sample(&mut self, reference: &mut Reference<S>, t: f64) {
        if reference.is_shared() {
            *self = spread(&reference.sample_shared(t));
            return;
        }
        reference.sample_each(t);
        for i in 0..D {
            self[i] = S::from_lanes(|lane| reference.all[lane * D + i]);
        }
    }
    #[inline(always)]
    fn lanes(&self) -> [S; D] {
        *self
    }
}
