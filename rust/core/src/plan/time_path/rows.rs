//! The dynamics along a path, in lanes over its points: with `v = q' r`, `a = q' u + q'' r^2` (`r = ds/dt`, `x = r^2`)
//!
//! ```text
//! tau = A u + B x + g (+ friction),   A = M q',   B = M q'' + C(q, q') q',   g = g(q)
//! ```
//!
//! three Newton-Euler recursions per point (Bobrow, Dubowsky and Gibson 1985). `A` and `B` are taken without gravity, so
//! that a short move does not drown in its weight.

use crate::arm::{Arm, Tree};
use crate::dynamics::{Dynamics, PlanarPr};
use crate::interrupt::look;
use crate::motion::Path;
use crate::scalar::{Real, Task, run_lanes};

/// The arm that moves: a tree of links, or the closed form.
#[derive(Clone, Copy, Debug)]
pub enum Mover<'a> {
    Tree(&'a Arm),
    PlanarPr(PlanarPr<f64>),
}

impl Mover<'_> {
    pub fn dof(&self) -> usize {
        match self {
            Mover::Tree(arm) => arm.n(),
            Mover::PlanarPr(_) => 2,
        }
    }

    pub fn joint_names(&self) -> Vec<String> {
        match self {
            Mover::Tree(arm) => arm.joint_names().map(String::from).collect(),
            Mover::PlanarPr(_) => vec!["p1".into(), "r2".into()],
        }
    }
}

/// Joint friction: `viscous v + coulomb sign(v)`, `(n,)` each.
#[derive(Clone, Debug, PartialEq)]
pub struct Friction {
    pub viscous: Vec<f64>,
    pub coulomb: Vec<f64>,
}

/// What is asked of the points of a path.
pub(super) struct Points<'a> {
    pub mover: Mover<'a>,
    pub path: &'a Path,
    /// The piece and the path position of each point.
    pub at: &'a (dyn Fn(usize) -> (usize, f64) + 'a),
    pub count: usize,
    /// Numbers per point in `out`.
    pub stride: usize,
    pub out: &'a mut [f64],
    pub ask: Ask<'a>,
}

pub(super) enum Ask<'a> {
    /// `[A, B, g]`, each `width` long, torques first, then accelerations if `accelerations`; and `q'` into `slopes` `(count, slope_stride)`.
    Coefficients { width: usize, torques: bool, accelerations: bool, slopes: &'a mut [f64], slope_stride: usize },
    /// `[tau, a, v]`, `(3 n,)`, at the path speed and acceleration given.
    Motion { rate: &'a (dyn Fn(usize) -> (f64, f64) + 'a) },
}

/// The block of number `j`, one entry per lane.
#[inline(always)]
fn lanes_at<S: Real>(staged: &[f64], j: usize) -> S {
    S::load(&staged[j * S::LANES..])
}

/// Numbers `from` of the first `lanes` lanes into rows `stride` apart.
#[inline(always)]
fn put<S: Real>(rows: &mut [f64], stride: usize, lanes: usize, at: usize, from: &[S]) {
    for j in 0..from.len() {
        let x = from[j];
        if lanes == S::LANES {
            for lane in 0..S::LANES {
                rows[lane * stride + at + j] = x.lane(lane);
            }
        } else {
            for lane in 0..lanes {
                rows[lane * stride + at + j] = x.lane(lane);
            }
        }
    }
}

/// Points between two looks whether to stop: a multiple of all numbers of lanes.
const LOOK: usize = 64;

impl Points<'_> {
    pub fn run(self) {
        run_lanes(self);
    }

    #[inline(always)]
    fn each<S: Real, D: Dynamics<S>>(self, arm: &mut D, weigh: impl Fn(&mut D, bool)) {
        let n = arm.dof();
        let mut workspace = arm.workspace();
        let zero = || vec![S::zero(); n];
        let (mut q, mut v, mut a, mut tau, rest) = (zero(), zero(), zero(), zero(), zero());
        let mut trig = vec![(S::zero(), S::zero()); n];
        let mut staged = vec![0.0; 3 * n * S::LANES];
        let (mut ask, out) = (self.ask, self.out);
        let mut first = 0;
        while first < self.count {
            if first % LOOK == 0 {
                look();
            }
            let lanes = S::LANES.min(self.count - first);
            for lane in 0..S::LANES {
                let k = first + lane.min(lanes - 1);
                let (piece, s) = (self.at)(k);
                let (rate, u) = match &ask {
                    Ask::Motion { rate } => rate(k),
                    Ask::Coefficients { .. } => (1.0, 0.0),
                };
                self.path.evaluate(piece, s, |j, q, d, e| {
                    let second = match &ask {
                        Ask::Motion { .. } => d * u + e * rate * rate,
                        Ask::Coefficients { .. } => e,
                    };
                    (staged[j * S::LANES + lane], staged[(n + j) * S::LANES + lane]) = (q, d * rate);
                    staged[(2 * n + j) * S::LANES + lane] = second;
                });
            }
            for j in 0..n {
                q[j] = lanes_at(&staged, j);
                v[j] = lanes_at(&staged, n + j);
                a[j] = lanes_at(&staged, 2 * n + j);
            }
            for j in 0..n {
                trig[j] = if arm.is_angle(j) { q[j].sin_cos() } else { (S::zero(), S::zero()) };
            }
            let rows = &mut out[first * self.stride..(first + lanes) * self.stride];
            let stride = self.stride;
            match &mut ask {
                Ask::Motion { .. } => {
                    arm.inverse_dynamics(&mut workspace, &trig, &q, &v, &a, &mut tau);
                    put(rows, stride, lanes, 0, &tau);
                    put(rows, stride, lanes, n, &a);
                    put(rows, stride, lanes, 2 * n, &v);
                }
                Ask::Coefficients { width, torques, accelerations, slopes, slope_stride } => {
                    if *torques {
                        weigh(arm, false);
                        arm.inverse_dynamics(&mut workspace, &trig, &q, &rest, &v, &mut tau);
                        put(rows, stride, lanes, 0, &tau);
                        arm.inverse_dynamics(&mut workspace, &trig, &q, &v, &a, &mut tau);
                        put(rows, stride, lanes, *width, &tau);
                        weigh(arm, true);
                        arm.inverse_dynamics(&mut workspace, &trig, &q, &rest, &rest, &mut tau);
                        put(rows, stride, lanes, 2 * *width, &tau);
                    }
                    if *accelerations {
                        let at = if *torques { n } else { 0 };
                        put(rows, stride, lanes, at, &v);
                        put(rows, stride, lanes, *width + at, &a);
                    }
                    put(&mut slopes[first * *slope_stride..], *slope_stride, lanes, 0, &v);
                }
            }
            first += S::LANES;
        }
    }
}

impl Task for Points<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        match self.mover {
            Mover::Tree(arm) => {
                let mut tree = Tree::<S>::new(arm);
                let gravity = tree.gravity;
                self.each(&mut tree, |tree, heavy| tree.gravity.0 = if heavy { gravity.0 } else { [0.0; 3] });
            }
            Mover::PlanarPr(arm) => {
                let mut arm = PlanarPr::<S>::from_lanes(|_| arm);
                self.each(&mut arm, |_, _| ());
            }
        }
    }
}
