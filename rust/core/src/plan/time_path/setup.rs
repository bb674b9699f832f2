//! The rows of the problem on a grid.

use super::check::{Course, Limits, TOLERANCE, WINDOW, inner_places};
use super::given::{PathLimits, TimePathOptions, checked};
use super::lines::{BLOCK, FASTEST, LimitRows};
use super::rows::{Ask, Friction, Mover, Points};
use super::stencil::Stencil;
use super::{PathReason, TimePath};
use crate::error::{Error, Result, finite};
use crate::memory;
use crate::motion::{Path, TimedPath};
use crate::scalar::sign;
use std::sync::Arc;

/// What stands for the root of `x`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    Chord,
    Tangent,
}

/// Fewest segments of a piece, unless the pieces are many.
pub(super) const PIECE: usize = 5;
/// Segments that are halved together: enough to be interpolated.
const RUN: usize = WINDOW - 1;
/// Halvings of a segment from one grid to the next.
const MOST_HALVINGS: u32 = 3;

/// The problem on a grid.
pub(super) struct PathProblem<'a> {
    pub mover: Mover<'a>,
    pub path: Arc<Path>,
    pub n: usize,
    pub rows: LimitRows,
    /// `(3 n,)`: torques, accelerations, speeds; infinite where there is no limit.
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    pub limits: Limits,
    /// Whether there are rows of torque, and of acceleration.
    pub kinds: [bool; 2],
    stencils: (Stencil<4>, Stencil<WINDOW>),
    /// The segments of each piece.
    spans: Vec<(usize, usize)>,
    /// `n` in whole blocks.
    stride: usize,
    pub friction: Option<Friction>,
    pub pieces: Vec<usize>,
    /// `(N + 1, n)`: `q'`.
    slopes: Vec<f64>,
    /// `(N + 1, 2 n)`: `B` and `g` of the torques without friction.
    bare: Vec<f64>,
    /// `(N + 1,)`: relative narrowing of the caps.
    pub cap_tight: Vec<f64>,
    /// `(N + 1,)`: the bounds of `x` from the speed limits as they are.
    widest: Vec<f64>,
    stops: Vec<f64>,
}

impl<'a> PathProblem<'a> {
    pub fn new(mover: Mover<'a>, path: Arc<Path>, given: &PathLimits, options: &TimePathOptions) -> Result<Self> {
        let n = mover.dof();
        let [lo, hi] = checked(n, &path, given, options)?;
        let stops = options.stops.iter().map(|&k| path.knots()[k]).collect();
        let (s, pieces) = grid(&path, options.points());
        // Rows of both kinds and of the speeds, the caps and the profiles at each point.
        const ROWS: usize = 12;
        memory::require((s.len() * 8).saturating_mul(ROWS * (3 * n).next_multiple_of(BLOCK) + 64))?;
        let rows = LimitRows {
            s,
            x_start: options.start_speed * options.start_speed,
            x_end: options.end_speed * options.end_speed,
            ..LimitRows::default()
        };
        let friction = options.friction.clone().filter(|_| given.torque.is_some());
        let mut problem = PathProblem {
            mover,
            path,
            n,
            rows,
            lo,
            hi,
            limits: Limits::default(),
            kinds: [given.torque.is_some(), given.acceleration.is_some()],
            stencils: (Stencil::new(&[0.5]), Stencil::new(&inner_places())),
            spans: Vec::new(),
            stride: n.next_multiple_of(BLOCK),
            friction,
            pieces,
            slopes: Vec::new(),
            bare: Vec::new(),
            cap_tight: Vec::new(),
            widest: Vec::new(),
            stops,
        };
        problem.fill();
        finite("path", &problem.rows.coefficients).map_err(|_| {
            Error::input(
                "path, arm",
                "give torques that are not finite: expected finite inertia, Coriolis and gravity torques along the path",
            )
        })?;
        Ok(problem)
    }

    /// The rows on the present grid.
    fn fill(&mut self) {
        let n = self.n;
        let mut limits = Limits::default();
        for kind in (0..2).filter(|&kind| self.kinds[kind]) {
            (kind * n..(kind + 1) * n).for_each(|k| limits.push(self.lo[k], self.hi[k]));
        }
        // Rows that only fill a block: 0 u + 0 x + 0 between -1 and 1.
        let fill = |limits: &mut Limits| (limits.lo.len()..limits.lo.len().next_multiple_of(BLOCK)).for_each(|_| limits.push(-1.0, 1.0));
        fill(&mut limits);
        let width = limits.lo.len();
        let points = self.rows.s.len();
        let rows = &mut self.rows;
        rows.width = width;
        (rows.lo, rows.hi) = (limits.lo.clone(), limits.hi.clone());
        (rows.scale_lo, rows.scale_hi) = (limits.scale_lo.clone(), limits.scale_hi.clone());
        if self.hi[2 * n] < f64::INFINITY {
            (2 * n..3 * n).for_each(|k| limits.push(self.lo[k], self.hi[k]));
            fill(&mut limits);
        }
        self.limits = limits;
        spans(&rows.s, &self.pieces, &mut self.spans);
        rows.tight_lo = vec![0.0; (points - 1) * width];
        rows.tight_hi = vec![0.0; (points - 1) * width];
        rows.u_slope = vec![0.0; points - 1];
        rows.coefficients.clear();
        rows.coefficients.resize(points * 3 * width, 0.0);
        self.cap_tight = vec![0.0; points];
        self.slopes.clear();
        self.slopes.resize(points * self.stride, 0.0);
        let pieces = &self.pieces;
        let s = &rows.s;
        let at = |k: usize| (pieces[k.min(pieces.len() - 1)], s[k]);
        let ask = Ask::Coefficients {
            width,
            torques: self.kinds[0],
            accelerations: self.kinds[1],
            slopes: &mut self.slopes,
            slope_stride: self.stride,
        };
        Points { mover: self.mover, path: &self.path, at: &at, count: points, stride: 3 * width, out: &mut rows.coefficients, ask }.run();
        self.rows.drop_rounding();
        if let (Some(friction), true) = (&self.friction, self.kinds[0]) {
            self.bare.resize(points * 2 * n, 0.0);
            for i in 0..points {
                for j in 0..n {
                    let c = &mut self.rows.coefficients[i * 3 * width..];
                    c[2 * width + j] += friction.coulomb[j] * sign(self.slopes[i * self.stride + j]);
                    (self.bare[2 * i * n + j], self.bare[(2 * i + 1) * n + j]) = (c[width + j], c[2 * width + j]);
                }
            }
        }
        self.widest = (0..points).map(|i| self.fastest(i).1.powi(2).min(FASTEST)).collect();
        self.set_middles();
        self.set_caps();
    }

    /// The rows half way between grid points, interpolated; linearly where a piece has too few points.
    fn set_middles(&mut self) {
        let w = 3 * self.rows.width;
        let segments = self.pieces.len();
        let PathProblem { rows: LimitRows { coefficients, middles, .. }, stencils: (stencil, _), spans, .. } = self;
        middles.resize(segments * w, 0.0);
        for &(first, last) in spans.iter() {
            for i in first..last {
                let to = &mut middles[i * w..(i + 1) * w];
                match stencil.of(i, first, last) {
                    Some((start, [[a, b, c, d]])) => {
                        let from = &coefficients[start * w..(start + 4) * w];
                        let (p, from) = from.split_at(w);
                        let (q, from) = from.split_at(w);
                        let (r, t) = from.split_at(w);
                        for k in 0..w {
                            to[k] = (a * p[k] + d * t[k]) + (b * q[k] + c * r[k]);
                        }
                    }
                    _ => {
                        let (p, q) = coefficients[i * w..(i + 2) * w].split_at(w);
                        for k in 0..w {
                            to[k] = 0.5 * (p[k] + q[k]);
                        }
                    }
                }
            }
        }
    }

    /// What the check sees.
    pub fn course(&self) -> Course<'_> {
        Course {
            mover: self.mover,
            path: &self.path,
            n: self.n,
            pieces: &self.pieces,
            spans: &self.spans,
            kinds: self.kinds,
            slopes: &self.slopes,
            stride: self.stride,
            friction: self.friction.as_ref(),
            limits: &self.limits,
            stencil: &self.stencils.1,
        }
    }

    /// The joint that limits the path speed at point `i` by its own speed, and the path speed then.
    pub fn fastest(&self, i: usize) -> (usize, f64) {
        let mut most = (0, f64::INFINITY);
        for j in 0..self.n {
            let slope = self.slopes[i * self.stride + j].abs();
            if slope > 0.0 && self.hi[2 * self.n + j] / slope < most.1 {
                most = (j, self.hi[2 * self.n + j] / slope);
            }
        }
        most
    }

    /// The bounds of `x` at the grid points, from the speed limits and the stops; those of the ends give way to the end speeds up
    /// to rounding.
    pub fn set_caps(&mut self) {
        let points = self.rows.s.len();
        self.rows.cap.resize(points, FASTEST);
        for i in 0..points {
            let cap = self.widest[i];
            let mut narrow = cap / (1.0 + self.cap_tight[i]);
            for (at, x) in [(0, self.rows.x_start), (points - 1, self.rows.x_end)] {
                // 4e-10 of the speed is 8e-10 of its square.
                if i == at && x <= cap * (1.0 + 8e-10) {
                    narrow = narrow.max(x);
                }
            }
            self.rows.cap[i] = narrow;
        }
        for stop in &self.stops {
            if let Ok(i) = self.rows.s.binary_search_by(|s| s.total_cmp(stop)) {
                self.rows.cap[i] = 0.0;
            }
        }
    }

    /// Rows without viscous friction.
    pub fn forget_friction(&mut self) {
        if self.friction.is_none() {
            return;
        }
        self.rows.moving.iter_mut().for_each(Vec::clear);
        let (n, w) = (self.n, self.rows.width);
        for i in 0..self.rows.s.len() {
            for j in 0..n {
                let c = &mut self.rows.coefficients[i * 3 * w..];
                (c[w + j], c[2 * w + j]) = (self.bare[2 * i * n + j], self.bare[(2 * i + 1) * n + j]);
            }
        }
        self.set_middles();
    }

    /// Viscous friction `d q' sqrt(x)` as a line through its value at the profile: the chord from rest, `d q' x / sqrt(x0)`, which
    /// leaves what is possible at low speeds possible, or the tangent, `d q' (sqrt(x0)/2 + x / (2 sqrt(x0)))`.
    pub fn linearise_friction(&mut self, x: &[f64], line: Line) {
        if self.friction.is_none() {
            return;
        }
        self.forget_friction();
        let Some(friction) = &self.friction else { return };
        let (n, w, last) = (self.n, self.rows.width, x.len() - 1);
        let (slope, rest) = match line {
            Line::Chord => (1.0, 0.0),
            Line::Tangent => (0.5, 0.5),
        };
        let LimitRows { coefficients, middles, moving, s, u_slope, .. } = &mut self.rows;
        moving[0].resize((last + 1) * w, 0.0);
        moving[1].resize(last * w, 0.0);
        for k in 0..=2 * last {
            // Grid points, and half way between them. At rest there is no friction.
            let (i, between) = (k / 2, k % 2 == 1);
            let here = if between { 0.5 * (x[i] + x[i + 1]) - 0.25 * (s[i + 1] - s[i]).powi(2) * u_slope[i] } else { x[i] };
            if !(here > 0.0) {
                continue;
            }
            let root = here.sqrt();
            let c = if between { &mut middles[i * 3 * w..] } else { &mut coefficients[i * 3 * w..] };
            let part = &mut moving[usize::from(between)][i * w..];
            for j in 0..n {
                let along = |i: usize| self.slopes[i * self.stride + j];
                let push = friction.viscous[j] * if between { 0.5 * (along(i) + along(i + 1)) } else { along(i) };
                c[w + j] += slope * push / root;
                part[j] = rest * push * root;
            }
        }
    }

    /// Halve segment `i` `times(i)` times. What is halved is a run of some segments, so that the rows can be interpolated in it.
    /// Whether anything was.
    pub fn refine(&mut self, times: impl Fn(usize) -> u32) -> bool {
        let (mut fine, mut pieces) = (Vec::new(), Vec::new());
        let s = &self.rows.s;
        for &(first, last) in &self.spans {
            let runs = ((last - first) / RUN).max(1);
            let end = |run: usize| first + (last - first) * run / runs;
            for run in 0..runs {
                // The neighbours of a run may be as coarse as it is.
                let near = end(run).saturating_sub(1).max(first)..(end(run + 1) + 1).min(last);
                let parts = 1_usize << near.map(&times).max().unwrap_or(0).min(MOST_HALVINGS);
                for i in end(run)..end(run + 1) {
                    for k in 0..parts {
                        let at = if k == 0 { s[i] } else { s[i] + (s[i + 1] - s[i]) * (k as f64 / parts as f64) };
                        if k == 0 || (at > fine[fine.len() - 1] && at < s[i + 1]) {
                            fine.push(at);
                            pieces.push(self.pieces[i]);
                        }
                    }
                }
            }
        }
        fine.push(s[s.len() - 1]);
        let more = fine.len() > s.len();
        (self.rows.s, self.pieces) = (fine, pieces);
        if more {
            self.fill();
        }
        more
    }

    /// The answer for a path that is one point: no time, if the arm can hold itself there.
    pub fn hold(&self) -> Result<TimePath> {
        let (row, upper, beyond) = self.tightest(0, 0.0, 0.0);
        if beyond > TOLERANCE {
            return self.refuse(PathReason::holding(self, row, upper, beyond));
        }
        Ok(TimePath { motion: TimedPath::still(self.path.clone()), margin: -beyond, reason: None })
    }

    /// The answer that there is none.
    pub fn refuse(&self, reason: PathReason) -> Result<TimePath> {
        let knots = self.path.knots();
        let ends = vec![knots[0], knots[knots.len() - 1]];
        let motion = TimedPath::new(self.path.clone(), ends, vec![f64::NAN; 2], vec![0.0])?;
        Ok(TimePath { motion, margin: f64::NAN, reason: Some(reason) })
    }
}

/// The even runs of segments within the pieces.
fn spans(s: &[f64], pieces: &[usize], spans: &mut Vec<(usize, usize)>) {
    spans.clear();
    let step = |i: usize| s[i + 1] - s[i];
    let mut first = 0;
    for i in 1..=pieces.len() {
        // Steps differ by rounding or by a factor of two.
        if i == pieces.len() || pieces[i] != pieces[first] || !(1.5 * step(i) > step(first) && step(i) < 1.5 * step(first)) {
            spans.push((first, i));
            first = i;
        }
    }
}

/// About `points` points, evenly within each piece, and the piece of each segment.
fn grid(path: &Path, points: usize) -> (Vec<f64>, Vec<usize>) {
    let knots = path.knots();
    let total = knots[knots.len() - 1] - knots[0];
    let (mut s, mut pieces) = (Vec::new(), Vec::new());
    let fewest = if PIECE * (knots.len() - 1) < points { PIECE } else { 1 };
    for p in 0..knots.len() - 1 {
        let (a, b) = (knots[p], knots[p + 1]);
        let segments = (((b - a) / total * (points - 1) as f64).round() as usize).max(fewest);
        for k in 0..segments {
            let at = a + (b - a) * (k as f64 / segments as f64);
            if s.last().is_none_or(|last| at > *last) {
                s.push(at);
                pieces.push(p);
            }
        }
    }
    s.push(knots[knots.len() - 1]);
    (s, pieces)
}
