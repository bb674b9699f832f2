//! The desired motion inside a loop: one for all lanes, or one per lane.

use crate::motion::{Motion, Table, sample_apart};
use crate::scalar::Real;

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

    #[inline(always)]
    pub fn sample(&mut self, t: f64, out: &mut [S]) {
        match self.table {
            Some(table) => table.sample(t, out),
            None => self.sample_motions(t, out),
        }
    }

    #[inline(always)]
    fn sample_motions(&mut self, t: f64, out: &mut [S]) {
        let width = out.len();
        if self.motions.len() == 1 {
            sample_apart(self.motions[0], t, &mut self.one);
            for i in 0..width {
                out[i] = S::splat(self.one[i].lane(0));
            }
            return;
        }
        for (motion, row) in self.motions.iter().zip(self.all.chunks_exact_mut(width)) {
            sample_apart(motion, t, row);
        }
        for i in 0..width {
            out[i] = S::from_lanes(|lane| self.all[lane * width + i]);
        }
    }
}
