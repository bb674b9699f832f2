//! The dynamics along a path `q(s)`, for many points together. `'` is `d/ds`, and `r = ds/dt`, `x = r^2`, `u = d^2 s/dt^2`. So `v = q' r`
//! and `a = q' u + q'' x`:
//!
//! ```text
//! tau = A u + B x + g (+ friction),   A = M q',   B = M q'' + C(q, q') q',   g = g(q)
//! ```
//!
//! `M` is the mass matrix, `C` the Coriolis matrix, and `g` the gravity torque. One function of the arm computes `A, B, g` (Bobrow,
//! Dubowsky and Gibson 1985). `tip` has the motion of a frame's origin.

use super::along::Along;
use super::mover::Mover;
use super::tip::{self, TIP};
use crate::dynamics::{Quantity, Query};
use crate::interrupt;
use crate::motion::Path;

/// Joint friction: `viscous v + coulomb sign(v)`, `(n,)` each.
///
/// ```
/// use armlet_core::plan::{Friction, Mover, PathLimits, TimePathOptions, time_path};
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Functions;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Functions::new(Arc::new(Arm::planar(&[1.0], None, None, None, [0.0, 0.0])?));
/// # let path = Arc::new(Path::waypoints(&[0.0, 1.0], 1, None, Ends::Natural)?.0);
/// // A rod with I = 1/3 kg m^2. Of 3 N m, friction leaves 2 N m to accelerate, and adds 1 N m to brake: T = 1 / sqrt(2).
/// let limits = PathLimits { torque: Some((vec![-3.0], vec![3.0])), ..PathLimits::default() };
/// let friction = Friction { viscous: vec![0.0], coulomb: vec![1.0] };
/// let options = TimePathOptions { friction: Some(friction), ..TimePathOptions::default() };
/// let plan = time_path(Mover::Tree(&arm), path, &limits, &options)?;
/// assert!((plan.motion.duration() - 0.5f64.sqrt()).abs() < 1e-4);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Friction {
    /// Viscous friction per joint, N m s/rad or N s/m.
    pub viscous: Vec<f64>,
    /// Coulomb friction per joint, N m or N.
    pub coulomb: Vec<f64>,
}

/// The points of a path, and the quantities to compute at them.
pub(super) struct Points<'a> {
    pub mover: Mover<'a>,
    pub path: &'a Path,
    /// The index of the piece and the path position of point `k`.
    pub at: &'a (dyn Fn(usize) -> (usize, f64) + 'a),
    pub count: usize,
    /// Numbers per point in `out`.
    pub stride: usize,
    pub out: &'a mut [f64],
    pub request: Request<'a>,
    /// The index of the frame whose origin is limited, and the limits that vary along the path.
    pub tip: Option<(usize, &'a Along)>,
}

pub(super) enum Request<'a> {
    /// Compute `[A, B, g]`, each `width` long: torques if `torques`, then accelerations if `accelerations`, then the frame's acceleration
    /// if `origins`. Write `dq/ds` to `slopes`, `(count, slope_stride)`, then `|dp/ds|` of the frame's origin `p`. A quantity of the frame
    /// is divided by its limit if this limit varies.
    Coefficients { width: usize, torques: bool, accelerations: bool, origins: bool, slopes: &'a mut [f64], slope_stride: usize },
    /// Compute `[tau, a, v]`, `(3 n,)`, at the path speed and path acceleration that `rate` returns. Then compute the frame's acceleration
    /// and velocity. Each of these is divided by its limit if this limit varies.
    Motion { rate: &'a (dyn Fn(usize) -> (f64, f64) + 'a) },
}

/// Number of points in one block, and between two checks for an interrupt.
const BLOCK_POINTS: usize = 64;

impl Points<'_> {
    // Long: all parts of the function share the arrays of one block of points.
    pub fn run(self) {
        let Points { mover, path, at, count, stride, out, mut request, tip } = self;
        let n = mover.dof();
        let (quantity, needed) = match &request {
            Request::Motion { .. } => (Quantity::InverseDynamics, true),
            Request::Coefficients { torques, .. } => (Quantity::PathDynamics, *torques),
        };
        let query = Query::from(quantity);
        if let (Mover::Tree(functions), true) = (mover, needed) {
            // The result is ignored: if the functions cannot be recorded and compiled as a program, they are evaluated directly.
            let _ = functions.prepare(&query, count);
        }
        let length = if quantity == Quantity::PathDynamics { 3 * n } else { n };
        let mut points = [const { Vec::new() }; 3];
        points.iter_mut().for_each(|x| x.resize(BLOCK_POINTS * n, 0.0));
        let mut answers = vec![0.0; BLOCK_POINTS * length];
        let mut tips = vec![0.0; if tip.is_some() { BLOCK_POINTS * TIP } else { 0 }];
        for first in (0..count).step_by(BLOCK_POINTS) {
            interrupt::check();
            let block = BLOCK_POINTS.min(count - first);
            let [q, v, a] = &mut points;
            for k in 0..block {
                let (piece, s) = at(first + k);
                let (rate, u) = match &request {
                    Request::Motion { rate } => rate(first + k),
                    Request::Coefficients { .. } => (1.0, 0.0),
                };
                path.evaluate(piece, s, |j, [x, d, e]| {
                    (q[k * n + j], v[k * n + j]) = (x, d * rate);
                    a[k * n + j] = match &request {
                        Request::Motion { .. } => d * u + e * rate * rate,
                        Request::Coefficients { .. } => e,
                    };
                });
            }
            if needed {
                let given = points.each_ref().map(|x| &x[..block * n]);
                mover.rows(&query, given, block, &mut answers[..block * length]);
            }
            if let Some((frame, _)) = tip {
                tip::motion(mover, frame, points.each_ref().map(|x| &x[..block * n]), block, TIP, &mut tips);
            }
            let [_, v, a] = &points;
            for k in 0..block {
                let (row, answer) = (&mut out[(first + k) * stride..(first + k + 1) * stride], &answers[k * length..(k + 1) * length]);
                let (v, a) = (&v[k * n..(k + 1) * n], &a[k * n..(k + 1) * n]);
                let mut put = |at: usize, from: &[f64]| row[at..at + n].copy_from_slice(from);
                match &mut request {
                    Request::Motion { .. } => {
                        [answer, a, v].into_iter().enumerate().for_each(|(i, from)| put(i * n, from));
                        if let Some((_, along)) = tip {
                            let (piece, s) = at(first + k);
                            let own = tips[k * TIP..(k + 1) * TIP].chunks_exact(3).zip(along.of_tip(path, piece, s));
                            for (to, (from, limit)) in row[3 * n..3 * n + TIP].chunks_exact_mut(3).zip(own) {
                                (0..3).for_each(|axis| to[axis] = from[axis] / limit);
                            }
                        }
                    }
                    Request::Coefficients { width, torques, accelerations, origins, slopes, slope_stride } => {
                        if *torques {
                            (0..3).for_each(|i| put(i * *width, &answer[i * n..(i + 1) * n]));
                        }
                        if *accelerations {
                            let at = if *torques { n } else { 0 };
                            put(at, v);
                            put(*width + at, a);
                        }
                        let own = (first + k) * *slope_stride;
                        slopes[own..own + n].copy_from_slice(v);
                        if let Some((_, along)) = tip {
                            let moved = &tips[k * TIP..(k + 1) * TIP];
                            let (piece, s) = at(first + k);
                            let [acceleration, speed] = along.of_tip(path, piece, s);
                            let first = n * (usize::from(*torques) + usize::from(*accelerations));
                            // At path speed one and path acceleration zero, acceleration and velocity are p'' and p'.
                            if *origins {
                                for axis in 0..3 {
                                    row[first + axis] = moved[3 + axis] / acceleration;
                                    row[*width + first + axis] = moved[axis] / acceleration;
                                }
                            }
                            slopes[own + n] = tip::length(&moved[3..]) / speed;
                        }
                    }
                }
            }
        }
    }
}
