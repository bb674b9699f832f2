//! The computation of each quantity of [`super::Evaluator`]: one type per quantity.

use super::buffered_tree::BufferedTree;
use super::energy::{add_friction, add_wrench};
use super::joined::Joined;
use super::{Dynamics, Quantity, Query, coriolis, crba, derivatives, regressor};
use crate::arm::Tree;
use crate::interrupt;
use crate::kinematics as kin;
use crate::memory;
use crate::scalar::rows::write_one;
use crate::scalar::{Real, sign};
use crate::spatial::{Lift, Matrix, Matrix3, PARAMETERS, Vector, Vector3, rotation_log};

/// The computation of a quantity from the buffers of a tree. Sines and cosines must already be in the buffers.
pub trait Compute {
    const QUANTITY: Quantity;
    fn compute<S: Real>(engine: &mut BufferedTree<S>, query: &Query);
    /// Compute the quantity, and write it to `out`. Return whether all numbers are finite.
    fn answer<S: Real>(engine: &mut BufferedTree<S>, query: &Query, out: &mut [f64]) -> bool {
        Self::compute(engine, query);
        write(&engine.out[..out.len()], out)
    }
}

/// Write a result as [`write_one`] does. A long result is written in pieces, with checks for a stop request.
#[inline(always)]
fn write<S: Real>(values: &[S], out: &mut [f64]) -> bool {
    if out.len() <= memory::PIECE { write_one(values, out) } else { write_many(values, out) }
}

#[inline(never)]
fn write_many<S: Real>(values: &[S], out: &mut [f64]) -> bool {
    let mut finite = true;
    for (values, out) in values.chunks(memory::PIECE).zip(out.chunks_mut(memory::PIECE)) {
        interrupt::check();
        finite &= write_one(values, out);
    }
    finite
}

/// Subtract the joint friction from a torque.
fn take_friction<S: Real>(query: &Query, tree: &Tree<S>, v: &[S], tau: &mut [S]) {
    if query.friction {
        for i in 0..tree.n() {
            let body = tree.leader(i);
            let viscous = body.damping.neg_mul_add(v[i], tau[i]);
            tau[i] = body.friction.neg_mul_add(sign(v[i]), viscous);
        }
    }
}

/// Write a homogeneous transform, `(4, 4)`, row by row.
fn write_pose<S: Real>(r: &Matrix3<S>, p: &Vector3<S>, out: &mut [S]) {
    for k in 0..3 {
        (out[4 * k], out[4 * k + 1], out[4 * k + 2], out[4 * k + 3]) = (r[(k, 0)], r[(k, 1)], r[(k, 2)], p[k]);
        out[12 + k] = S::zero();
    }
    out[15] = S::splat(1.0);
}

macro_rules! quantity {
    ($name:ident, ($tree:ident, $ws:ident, $trig:ident, $n:ident, $q:ident, $v:ident, $x:ident, $y:ident, $out:ident, $query:ident, $square:ident), $body:expr) => {
        pub struct $name;
        impl Compute for $name {
            const QUANTITY: Quantity = Quantity::$name;
            #[allow(unused_variables)]
            fn compute<S: Real>(engine: &mut BufferedTree<S>, $query: &Query) {
                let BufferedTree { tree: $tree, ws: $ws, trig, inputs, out, square: $square, .. } = engine;
                let $n = $tree.n();
                let size = $tree.size();
                let [q, v, x, $y] = inputs;
                let ($trig, $q, $v, $x) = (&trig[..$n], &q[..$n], &v[..$n], &mut x[..$n]);
                let $out = &mut out[..$query.length(size)];
                $body
            }
        }
    };
}

pub struct MassMatrix;
impl Compute for MassMatrix {
    const QUANTITY: Quantity = Quantity::MassMatrix;
    fn compute<S: Real>(engine: &mut BufferedTree<S>, _: &Query) {
        if let Some(joined) = Joined::of(&engine.tree) {
            let n = engine.tree.n();
            return joined.mass_matrix(&mut engine.ws, (&engine.trig, &engine.inputs[0]), &mut engine.out[..n * n]);
        }
        // `out` is set to zero only if the last query was different. Entries that are zero at every state remain zero.
        crba::mass_matrix_on_zeros(&engine.tree, &mut engine.ws.mass, &engine.trig, &engine.inputs[0], &mut engine.out);
    }
    /// Write each entry directly to `out`, not to the buffer `engine.out`, unless joints follow others.
    fn answer<S: Real>(engine: &mut BufferedTree<S>, query: &Query, out: &mut [f64]) -> bool {
        let n = engine.tree.n();
        if engine.tree.joining.is_some() {
            Self::compute(engine, query);
            return write(&engine.out[..n * n], out);
        }
        if engine.tree.bodies.iter().any(|body| body.end < n) {
            memory::set(out, 0.0);
        }
        // `zero` becomes NaN after a number that is not finite.
        let mut zero = S::zero();
        crba::mass_matrix_entries(&engine.tree, &mut engine.ws.mass, &engine.trig, &engine.inputs[0], |i, j, x| {
            zero = x.mul_add(S::zero(), zero);
            // The sum with zero removes the sign of a zero, as in `write_one`.
            out[i * n + j] = x.lane(0) + 0.0;
            out[j * n + i] = x.lane(0) + 0.0;
        });
        S::all(zero.lt(S::splat(1.0)))
    }
}

quantity!(CoriolisMatrix, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    tree.coriolis_matrix(ws, trig, q, v, out);
});

quantity!(Christoffel, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    coriolis::christoffel(tree, ws, trig, q, x, &mut square[..n * n], out);
});

quantity!(Gravity, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    tree.gravity(ws, trig, q, out);
});

quantity!(Bias, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    tree.bias(ws, trig, q, v, out);
    if query.friction {
        add_friction(tree, v, out);
    }
});

quantity!(InverseDynamics, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    tree.inverse_dynamics(ws, trig, q, v, x, out);
    if query.friction {
        add_friction(tree, v, out);
    }
    if let Some(frame) = query.wrench {
        kin::place(tree, trig, q, &mut ws.poses);
        add_wrench(tree, &ws.poses, frame, std::array::from_fn(|k| y[k]), -S::splat(1.0), out);
    }
});

quantity!(PathDynamics, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    let (inertia, rest) = out.split_at_mut(n);
    let (curvature, weight) = rest.split_at_mut(n);
    let still = &mut y[..n];
    still.fill(S::zero());
    let gravity = std::mem::take(&mut tree.gravity);
    tree.inverse_dynamics(ws, trig, q, still, v, inertia);
    tree.inverse_dynamics(ws, trig, q, v, x, curvature);
    tree.gravity = gravity;
    tree.inverse_dynamics(ws, trig, q, still, still, weight);
});

quantity!(ForwardDynamics, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    take_friction(query, tree, v, x);
    if let Some(frame) = query.wrench {
        kin::place(tree, trig, q, &mut ws.poses);
        add_wrench(tree, &ws.poses, frame, std::array::from_fn(|k| y[k]), S::splat(1.0), x);
    }
    tree.forward_dynamics(ws, trig, q, v, x, out);
});

quantity!(Regressor, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    let (_, width) = query.shape(tree.size());
    match Joined::of(tree) {
        Some(joined) => joined.regressor(ws, (trig, q), [v, x, &y[..n]], width, out),
        None => regressor::regressor(tree, width, ws, trig, q, [v, x, &y[..n]], out),
    }
    for i in 0..n {
        let mut at = i * width + PARAMETERS * tree.bodies.len() + i;
        if query.armature {
            out[at] = y[i];
            at += n;
        }
        if query.friction {
            (out[at], out[at + n]) = (x[i], sign(v[i]));
            at += 2 * n;
        }
        if query.offset {
            out[at] = S::splat(1.0);
        }
    }
});

quantity!(Energy, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    (out[0], out[1]) = tree.energy(ws, trig, q, v);
});

quantity!(Pose, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    let (r, p) = kin::frame_pose(tree, &mut ws.poses, trig, q, query.frame);
    write_pose(&r, &p, out);
});

quantity!(JointPoses, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    kin::place(tree, trig, q, &mut ws.poses);
    for ((pose, body), out) in ws.poses.iter().zip(&tree.bodies).zip(out.chunks_exact_mut(16)) {
        let r = body.turn.map_or(pose.rotation, |turn| pose.rotation.times(turn.transpose().lift()));
        write_pose(&r, &pose.origin, out);
    }
});

quantity!(PoseVector, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    let (r, p) = kin::frame_pose(tree, &mut ws.poses, trig, q, query.frame);
    let (position, turn) = out.split_at_mut(3);
    position.copy_from_slice(&p.array());
    turn.copy_from_slice(&rotation_log(&r).array());
});

quantity!(Position, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    out.copy_from_slice(&kin::frame_pose(tree, &mut ws.poses, trig, q, query.frame).1.array());
});

quantity!(Jacobian, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    kin::jacobian_on_zeros(tree, &mut ws.poses, trig, q, query.frame, out);
});

quantity!(JacobianDot, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    kin::jacobian_dot(tree, &mut ws.poses, &mut ws.motion, (trig, q), v, query.frame, out);
});

quantity!(Com, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    out.copy_from_slice(&kin::com(tree, &mut ws.poses, trig, q).1.array());
});

quantity!(InverseDynamicsDerivatives, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    let (by_q, rest) = out.split_at_mut(n * n);
    let (by_v, by_a) = rest.split_at_mut(n * n);
    derivatives::inverse_dynamics_by_q(tree, ws, trig, q, v, x, by_q);
    derivatives::inverse_dynamics_by_v(tree, ws, trig, q, v, query.friction, by_v);
    tree.mass_matrix(ws, trig, q, by_a);
});

quantity!(ForwardDynamicsDerivatives, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    take_friction(query, tree, v, x);
    let (by_q, rest) = out.split_at_mut(n * n);
    let (by_v, by_tau) = rest.split_at_mut(n * n);
    tree.forward_dynamics(ws, trig, q, v, x, &mut y[..n]);
    derivatives::forward_dynamics_derivatives(tree, ws, (trig, q), (v, &y[..n]), query.friction, square, [by_q, by_v, by_tau]);
});

quantity!(ComJacobian, (tree, ws, trig, n, q, v, x, y, out, query, square), {
    kin::com_jacobian(tree, &mut ws.poses, &mut ws.subtrees, trig, q, out);
});
