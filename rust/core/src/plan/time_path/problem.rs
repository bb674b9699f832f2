//! The planning problem on a grid of path positions `s_i`, in the form of Bobrow, Dubowsky and Gibson (1985) and of Pham and Pham (2018):
//!
//! ```text
//! lo <= A_i u + B_i x + g_i <= hi,   x <= C_i                     u = d^2 s/dt^2,   x = (ds/dt)^2
//! torques          A = M q',   B = M q'' + C(q, q') q',   g = g(q) + Coulomb friction                 (`rows`)
//! accelerations    A = q',     B = q'',                   g = 0
//! frame's origin   A = p',     B = p'',                   g = 0,   and |p' u + p'' x| <= a_max        (`tip`)
//! ```
//!
//! `'` is `d/ds`, `M` the mass matrix and `C(q, q')` the Coriolis matrix. `p` is the frame's origin. The caps `C_i` follow from the speed
//! limits (`caps`). Viscous friction is added as a line in `x` (`friction`).

use super::along::Along;
use super::given::{Checked, PathLimits, TimePathOptions, checked};
use super::grid::{grid, halved, spans};
use super::limits::Limits;
use super::lines::{BLOCK, LimitRows};
use super::mover::Mover;
use super::rows::{Friction, Points, Request};
use super::stencil::{Stencil, inner_places};
use super::tip::{TIP, Tip};
use super::tuning::CHECK_NODES;
use crate::error::{Error, Result, finite};
use crate::memory;
use crate::motion::Path;
use crate::scalar::sign;
use std::sync::Arc;

/// The problem on a grid.
pub(super) struct PathProblem<'a> {
    pub mover: Mover<'a>,
    pub path: Arc<Path>,
    pub n: usize,
    pub rows: LimitRows,
    /// `(3 n,)`: lower limits of torques, accelerations and speeds; `-inf` where there is no limit, -1 where a limit varies along the path.
    pub lo: Vec<f64>,
    /// `(3 n,)`: upper limits of torques, accelerations and speeds; `inf` where there is no limit, 1 where a limit varies along the path.
    pub hi: Vec<f64>,
    /// Whether there are rows of torques, and rows of accelerations.
    pub kinds: [bool; 2],
    /// The weights for interpolation between grid points: at the middle of a segment, and at the places inside it where the limits are
    /// checked.
    pub stencils: (Stencil<4>, Stencil<CHECK_NODES>),
    /// The groups of consecutive segments of equal length within a piece, as first index and end index.
    pub spans: Vec<(usize, usize)>,
    /// The numbers per grid point in `slopes`, padded to a multiple of `BLOCK`.
    pub stride: usize,
    pub friction: Option<Friction>,
    pub along: Along,
    pub tip: Option<Tip>,
    /// The index in `limits` of the first row that limits a joint's speed; `None` without speed limits.
    pub speeds: Option<usize>,
    /// The index in `limits` of the norm of the frame's acceleration. The norm of the frame's speed is the next row. `None` without tip
    /// limits.
    pub norms: Option<usize>,
    /// `(N,)`: the index of the piece of each segment.
    pub pieces: Vec<usize>,
    /// `(N + 1, stride)`: `dq/ds` at the grid points; then `|dp/ds|` of the frame's origin `p`, divided by the frame's speed limit if that
    /// varies.
    pub slopes: Vec<f64>,
    /// `(N + 1, 2 n)`: `B` and `g` of the torques `A u + B x + g` without viscous friction. `g` includes Coulomb friction. Empty without
    /// friction.
    pub bare: Vec<f64>,
    /// `(N + 1,)`: the relative reduction of the caps.
    pub cap_tight: Vec<f64>,
    /// `(N + 1,)`: the strictest speed limit at each point. The entries are its row in `limits` and the bound of `x` that the limit gives
    /// without reduction.
    pub speed_caps: Vec<(usize, f64)>,
    /// Path positions where the motion stops.
    pub stops: Vec<f64>,
}

impl<'a> PathProblem<'a> {
    pub fn new(mover: Mover<'a>, path: Arc<Path>, given: &PathLimits, options: &TimePathOptions) -> Result<Self> {
        let n = mover.dof();
        let Checked { lo, hi, along, tip } = checked(mover, &path, given, options)?;
        let stops = options.stops.iter().map(|&k| path.knots()[k]).collect();
        let (s, pieces) = grid(&path, options.points());
        // The approximate number of stored numbers per grid point and row: the coefficients of the rows, and the lines. The term 64 counts
        // caps, profiles and other numbers per grid point.
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
            kinds: [given.torque.is_some(), given.acceleration.is_some()],
            stencils: (Stencil::new(&[0.5]), Stencil::new(&inner_places())),
            spans: Vec::new(),
            stride: (n + usize::from(tip.is_some())).next_multiple_of(BLOCK),
            friction,
            along,
            tip,
            speeds: None,
            norms: None,
            pieces,
            slopes: Vec::new(),
            bare: Vec::new(),
            cap_tight: Vec::new(),
            speed_caps: Vec::new(),
            stops,
        };
        problem.compute_rows();
        finite("path", &problem.rows.coefficients).map_err(|_| {
            Error::input(
                "path, arm",
                "give torques that are not finite: expected finite inertia, Coriolis and gravity torques along the path",
            )
        })?;
        Ok(problem)
    }

    /// Compute the rows on the present grid.
    pub fn compute_rows(&mut self) {
        let n = self.n;
        let mut limits = Limits::default();
        for kind in (0..2).filter(|&kind| self.kinds[kind]) {
            (kind * n..(kind + 1) * n).for_each(|k| limits.push(self.lo[k], self.hi[k]));
        }
        let ball = self.tip.as_ref().and_then(|tip| tip.acceleration).map(|most| (limits.lo.len(), most));
        if let Some((_, most)) = ball {
            // Each component of the frame's acceleration is within the limit of its norm.
            (0..3).for_each(|_| limits.push(-most, most));
        }
        // Padding rows: 0 u + 0 x + 0 is always between -1 and 1.
        let pad = |limits: &mut Limits| (limits.lo.len()..limits.lo.len().next_multiple_of(BLOCK)).for_each(|_| limits.push(-1.0, 1.0));
        pad(&mut limits);
        let width = limits.lo.len();
        let points = self.rows.s.len();
        let rows = &mut self.rows;
        rows.width = width;
        rows.ball = ball;
        if self.hi[2 * n] < f64::INFINITY {
            self.speeds = Some(limits.lo.len());
            (2 * n..3 * n).for_each(|k| limits.push(self.lo[k], self.hi[k]));
            pad(&mut limits);
        }
        if let Some(tip) = &self.tip {
            self.norms = Some(limits.lo.len());
            for most in [tip.acceleration, tip.speed] {
                let most = most.unwrap_or(f64::MAX);
                limits.push(-most, most);
            }
            pad(&mut limits);
        }
        rows.limits = limits;
        spans(&rows.s, &self.pieces, &mut self.spans);
        rows.tight_lo = vec![0.0; (points - 1) * width];
        rows.tight_hi = vec![0.0; (points - 1) * width];
        rows.u_slope = vec![0.0; points - 1];
        rows.coefficients = vec![0.0; points * 3 * width];
        self.cap_tight = vec![0.0; points];
        self.slopes = vec![0.0; points * self.stride];
        let pieces = &self.pieces;
        let s = &rows.s;
        let at = |k: usize| (pieces[k.min(pieces.len() - 1)], s[k]);
        let request = Request::Coefficients {
            width,
            torques: self.kinds[0],
            accelerations: self.kinds[1],
            origins: ball.is_some(),
            slopes: &mut self.slopes,
            slope_stride: self.stride,
        };
        let tip = self.tip.as_ref().map(|tip| (tip.frame, &self.along));
        let out = &mut rows.coefficients;
        Points { mover: self.mover, path: &self.path, at: &at, count: points, stride: 3 * width, out, request, tip }.run();
        self.divide_by_limits();
        self.rows.drop_rounding();
        if let (Some(friction), true) = (&self.friction, self.kinds[0]) {
            self.bare.resize(points * 2 * n, 0.0);
            for i in 0..points {
                for j in 0..n {
                    let limit = self.along_at(0, i, j);
                    let c = &mut self.rows.coefficients[i * 3 * width..];
                    c[2 * width + j] += friction.coulomb[j] * sign(self.slopes[i * self.stride + j]) / limit;
                    (self.bare[2 * i * n + j], self.bare[(2 * i + 1) * n + j]) = (c[width + j], c[2 * width + j]);
                }
            }
        }
        self.set_speed_caps();
        self.set_middles();
        self.set_caps();
    }

    /// Halve segments ([`halved`]), and compute the rows on the new grid. Return whether any segment was halved.
    pub fn refine(&mut self, times: impl Fn(usize) -> u32) -> bool {
        let (s, pieces) = halved(&self.rows.s, &self.pieces, &self.spans, times);
        let more = s.len() > self.rows.s.len();
        (self.rows.s, self.pieces) = (s, pieces);
        if more {
            self.compute_rows();
        }
        more
    }

    /// The limit of `joint` at grid point `i` if it varies along the path. If it is constant, the result is 1, not the limit. `kind` is 0
    /// for torque, 1 for acceleration, 2 for speed.
    pub fn along_at(&self, kind: usize, i: usize, joint: usize) -> f64 {
        self.along.limit(&self.path, kind, joint, self.pieces[i.min(self.pieces.len() - 1)], self.rows.s[i])
    }

    /// Divide the rows of torques and accelerations by limits that vary.
    fn divide_by_limits(&mut self) {
        let (n, width) = (self.n, self.rows.width);
        for kind in (0..2).filter(|&kind| !self.along.limits[kind].is_empty()) {
            let first = if kind == 1 && self.kinds[0] { n } else { 0 };
            for i in 0..self.rows.s.len() {
                for j in 0..n {
                    let limit = self.along_at(kind, i, j);
                    (0..3).for_each(|part| self.rows.coefficients[(3 * i + part) * width + first + j] /= limit);
                }
            }
        }
    }

    /// Interpolate the rows at the midpoints of segments: `f(z) = sum_k w_k f_k` (`stencil`). The interpolation is linear where neighbouring
    /// segments of equal length have too few points.
    pub fn set_middles(&mut self) {
        let row = 3 * self.rows.width;
        let segments = self.pieces.len();
        let PathProblem { rows: LimitRows { coefficients, middles, .. }, stencils: (stencil, _), spans, .. } = self;
        middles.resize(segments * row, 0.0);
        for &(first, last) in spans.iter() {
            for i in first..last {
                let middle = &mut middles[i * row..(i + 1) * row];
                match stencil.of(i, first, last) {
                    Some((start, [[w_0, w_1, w_2, w_3]])) => {
                        let (f_0, f) = coefficients[start * row..(start + 4) * row].split_at(row);
                        let (f_1, f) = f.split_at(row);
                        let (f_2, f_3) = f.split_at(row);
                        for k in 0..row {
                            middle[k] = (w_0 * f_0[k] + w_3 * f_3[k]) + (w_1 * f_1[k] + w_2 * f_2[k]);
                        }
                    }
                    _ => {
                        let (f_0, f_1) = coefficients[i * row..(i + 2) * row].split_at(row);
                        for k in 0..row {
                            middle[k] = 0.5 * (f_0[k] + f_1[k]);
                        }
                    }
                }
            }
        }
    }

    /// Number of values per sample that the dynamics computes.
    pub fn measured(&self) -> usize {
        3 * self.n + if self.tip.is_some() { TIP } else { 0 }
    }

    /// Undo all reductions of limits, the slopes of `u` and the lines of viscous friction.
    pub fn remove_reductions(&mut self) {
        for values in [&mut self.rows.tight_lo, &mut self.rows.tight_hi, &mut self.rows.u_slope, &mut self.cap_tight] {
            values.fill(0.0);
        }
        self.set_caps();
        self.remove_friction();
    }

    /// Require that the frame moves on every segment, if neither torque nor joint acceleration is limited. Errors: `Input`.
    pub fn require_motion(&self) -> Result<()> {
        if self.kinds != [false; 2] {
            return Ok(());
        }
        let slope = |i: usize| self.slopes[i * self.stride + self.n];
        let largest = (0..self.rows.s.len()).map(slope).fold(0.0, f64::max);
        let still = |i: &usize| !(slope(*i) > 1e-9 * largest) && !(slope(i + 1) > 1e-9 * largest);
        match (0..self.pieces.len()).find(still) {
            None => Ok(()),
            Some(i) => Err(Error::input(
                "tau_max, a_max",
                format!("are both missing: expected one of them where the frame does not move, at s = {}", self.rows.s[i]),
            )),
        }
    }
}
