//! Regressors of many configurations, from lanes straight to where their rows belong: `(count, n, p)`.
//!
//! Ten numbers of every lane at a time are transposed in registers. The rows of one group fill the first-level cache, so each number is
//! written once, row by row, and never read; memory is asked for its lines shortly before.

use super::Query;
use super::evaluate::Engine;
use super::regressor::{Blocks, regressor_blocks};
use crate::scalar::lanes::prefetch;
use crate::scalar::rows::read_rows;
use crate::scalar::{Real, sign};
use crate::spatial::PARAMETERS;

/// Numbers of a row that are moved at once, and of a line of memory.
const LINE: usize = 8;
/// How far ahead memory is asked for, in numbers: two lines of each row. Those of more would not stay in the first-level cache.
const AHEAD: usize = 2 * LINE;

/// The rows of one group of configurations.
struct Rows<'a, S> {
    rows: &'a mut [f64],
    /// Numbers of a configuration, and of a joint.
    length: usize,
    width: usize,
    /// Zero, or NaN once a number was not finite; apart, so that no sum waits for another.
    zeros: [S; 5],
}

impl<S: Real> Rows<'_, S> {
    /// Zeros, `count` numbers from `at` in every row.
    #[inline(always)]
    fn clear(&mut self, at: usize, count: usize) {
        let mut k = 0;
        while k + LINE <= count {
            self.ask(at + k);
            S::to_rows(&[S::zero(); LINE], &mut self.rows[at + k..], self.length);
            k += LINE;
        }
        while k + 2 <= count {
            S::two_to_rows([S::zero(); 2], &mut self.rows[at + k..], self.length);
            k += 2;
        }
        if k < count {
            self.number(at + k, S::zero());
        }
    }

    #[inline(always)]
    fn number(&mut self, at: usize, x: S) {
        for lane in 0..S::LANES {
            self.rows[lane * self.length + at] = x.lane(lane);
        }
        self.zeros[0] = x.mul_add(S::zero(), self.zeros[0]);
    }

    /// Ask for the lines that are written soon after `at`; at the end of the rows, for the first of the next ones.
    #[inline(always)]
    fn ask(&self, at: usize) {
        let soon = at + AHEAD;
        let soon = if soon < self.length { soon } else { soon + (S::LANES - 1) * self.length };
        for lane in 0..S::LANES {
            prefetch(self.rows.as_ptr().wrapping_add(soon + lane * self.length));
        }
    }
}

impl<S: Real> Blocks<S> for Rows<'_, S> {
    #[inline(always)]
    fn put(&mut self, joint: usize, body: usize, block: &[S; PARAMETERS]) {
        if joint == body {
            // Earlier bodies are not carried by this joint.
            self.clear(joint * self.width, PARAMETERS * joint);
        }
        let [a, b, c, d, e, f, g, h, last @ ..] = *block;
        let at = joint * self.width + PARAMETERS * body;
        self.ask(at);
        self.ask(at + LINE);
        S::to_rows(&[a, b, c, d, e, f, g, h], &mut self.rows[at..], self.length);
        S::two_to_rows(last, &mut self.rows[at + LINE..], self.length);
        for k in 0..PARAMETERS {
            self.zeros[k % 5] = block[k].mul_add(S::zero(), self.zeros[k % 5]);
        }
    }
}

/// As `Engine::side_by_side`, of regressors.
#[inline(always)]
pub(super) fn regressor_rows<S: Real>(engine: &mut Engine<S>, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
    let Engine { tree, ws, trig, inputs: lanes, rows: rest, .. } = engine;
    let n = tree.n();
    let (length, width) = (query.length(n), query.shape(n).1);
    let inertial = PARAMETERS * n;
    let (mut at, mut sound) = (0, true);
    while at < count {
        for (k, given) in inputs.iter().enumerate() {
            read_rows(given, at, count, n, &mut lanes[k][..n]);
        }
        let [q, v, v_r, a_r] = lanes;
        let (q, v, v_r, a_r, trig) = (&q[..n], &v[..n], &v_r[..n], &a_r[..n], &mut trig[..n]);
        S::sin_cos_each(q, trig);
        let whole = at + S::LANES <= count;
        let rows = if whole { &mut out[at * length..][..S::LANES * length] } else { &mut rest[..S::LANES * length] };
        let mut to = Rows { rows, length, width, zeros: [S::zero(); 5] };
        for (j, body) in tree.bodies.iter().enumerate() {
            // Of branches beside it, and columns that are not inertial.
            to.clear(j * width + PARAMETERS * body.end, width - PARAMETERS * body.end);
        }
        regressor_blocks(tree, &mut ws.links, &mut ws.fields, trig, q, v, v_r, a_r, &mut to);
        for i in 0..n {
            let mut at = i * width + inertial + i;
            if query.armature {
                to.number(at, a_r[i]);
                at += n;
            }
            if query.friction {
                to.number(at, v_r[i]);
                to.number(at + n, sign(v[i]));
            }
        }
        let [a, b, c, d, e] = to.zeros;
        // A comparison with NaN fails.
        sound &= S::all(((a + b) + (c + d) + e).lt(S::splat(1.0)));
        if !whole {
            let last = &mut out[at * length..];
            last.copy_from_slice(&rest[..last.len()]);
        }
        at += S::LANES;
    }
    sound
}
