//! The desired motion inside a loop: one for all lanes, or one per lane.

use crate::motion::{Motion, Table, sample_apart};
use crate::scalar::{Real, spread};

/// Samples of one motion that are kept at a time: those of a step's start, middle and end, and one between steps.
const KEPT: usize = 4;

/// Where a loop's `[q_d, v_d, a_d]` comes from.
pub struct Reference<'a, S: Real> {
    /// A motion sampled in advance, and its rows, read in place.
    table: Option<&'a Table>,
    rows: &'a [f64],
    /// One motion, or one per lane.
    motions: Vec<&'a Motion>,
    /// The sample of one motion, `(3 n,)`.
    one: Vec<S::One>,
    /// The last samples of one motion that are in no table, `(KEPT, 3 n)`, and the place of the next.
    kept: Vec<f64>,
    next: usize,
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
        let rows = table.map_or(&[][..], Table::rows);
        let width = 3 * first.dof();
        let one = vec![S::One::zero(); width];
        let all = vec![0.0; if motions.len() > 1 { width * motions.len() } else { 0 }];
        Reference { table, rows, motions, one, kept: vec![0.0; KEPT * width], next: 0, all }
    }

    /// Whether one motion serves all lanes.
    pub fn is_shared(&self) -> bool {
        self.motions.len() == 1
    }

    /// Find the sample of the one motion of all lanes in its table, or take it.
    #[inline(always)]
    fn place(&mut self, t: f64) -> usize {
        match self.table.and_then(|table| table.knot(t)) {
            Some(at) => at,
            None => self.take(t),
        }
    }

    #[inline(never)]
    fn take(&mut self, t: f64) -> usize {
        sample_apart(self.motions[0], t, &mut self.one);
        let at = self.next;
        for (to, from) in self.kept[at..].iter_mut().zip(&self.one) {
            *to = from.lane(0);
        }
        self.next = (at + self.one.len()) % self.kept.len();
        self.rows.len() + at
    }

    /// The sample at a place, read where it stands: in the table, or, counting on from its end, among those kept.
    #[inline(always)]
    fn at<const D: usize>(&self, place: usize) -> &[f64; D] {
        let row = match self.rows.get(place..) {
            Some(rest) if !rest.is_empty() => rest.first_chunk(),
            _ => self.kept.get(place - self.rows.len()..).and_then(|rest| rest.first_chunk()),
        };
        row.unwrap_or(&[f64::NAN; D])
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
    fn lanes(&self, reference: &Reference<S>) -> Self::Lanes;
}

/// One motion for all lanes: the place of a row of `D` numbers.
#[derive(Clone, Copy, Default)]
pub struct Shared<const D: usize>(usize);

impl<S: Real, const D: usize> Desired<S> for Shared<D> {
    type Lanes = [S; D];
    #[inline(always)]
    fn sample(&mut self, reference: &mut Reference<S>, t: f64) {
        self.0 = reference.place(t);
    }
    #[inline(always)]
    fn lanes(&self, reference: &Reference<S>) -> [S; D] {
        spread(reference.at(self.0))
    }
}

/// Whatever the lanes share or not.
impl<S: Real, const D: usize> Desired<S> for [S; D] {
    type Lanes = [S; D];
    #[inline(always)]
    fn sample(&mut self, reference: &mut Reference<S>, t: f64) {
        if reference.is_shared() {
            let place = reference.place(t);
            *self = spread(reference.at(place));
            return;
        }
        reference.sample_each(t);
        for i in 0..D {
            self[i] = S::from_lanes(|lane| reference.all[lane * D + i]);
        }
    }
    #[inline(always)]
    fn lanes(&self, _: &Reference<S>) -> [S; D] {
        *self
    }
}
