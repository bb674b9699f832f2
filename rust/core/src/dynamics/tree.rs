//! The trait [`Dynamics`] for a tree of bodies. A recursion computes each quantity, and the result is projected if joints follow others.

use super::joined::Joined;
use super::workspace::Workspace;
use super::{Dynamics, aba, coriolis, crba, energy, forward, newton_euler, regressor};
use crate::arm::Tree;
use crate::memory::set;
use crate::scalar::Real;
use crate::spatial::PARAMETERS;

impl<S: Real> Dynamics<S> for Tree<S> {
    type Workspace = Workspace<S>;
    fn workspace(&self) -> Workspace<S> {
        Workspace::new(self)
    }
    fn dof(&self) -> usize {
        self.n()
    }
    fn parameter_count(&self) -> usize {
        PARAMETERS * self.bodies.len()
    }
    fn is_angle(&self, joint: usize) -> bool {
        self.leader(joint).revolute
    }
    fn parameters(&self, pi: &mut [S]) {
        self.write_parameters(pi);
    }
    fn mass_matrix(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], m: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.mass_matrix(ws, (trig, q), m);
        }
        crba::mass_matrix(self, &mut ws.mass, trig, q, m);
    }
    fn coriolis_matrix(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], c: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.coriolis_matrix(ws, (trig, q), v, c);
        }
        coriolis::coriolis_matrix(self, ws, trig, q, v, c);
    }
    fn gravity(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], g: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.gravity(ws, (trig, q), g);
        }
        energy::gravity(self, &mut ws.poses, &mut ws.composites, trig, q, g);
    }
    fn bias(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], out: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.inverse_dynamics(ws, (trig, q), v, None, out);
        }
        newton_euler::newton_euler(self, &mut ws.links, trig, q, v, None, out);
    }
    fn inverse_dynamics(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], a: &[S], tau: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.inverse_dynamics(ws, (trig, q), v, Some(a), tau);
        }
        newton_euler::newton_euler(self, &mut ws.links, trig, q, v, Some(a), tau);
    }
    fn forward_dynamics(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], tau: &[S], a: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.forward_dynamics(ws, (trig, q), v, tau, a);
        }
        if self.is_shallow {
            forward::forward_dynamics(self, ws, trig, q, v, tau, a);
        } else {
            aba::forward_dynamics(self, ws, trig, q, v, tau, a);
        }
    }
    fn regressor(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], rates: [&[S]; 3], y: &mut [S]) {
        if let Some(joined) = Joined::of(self) {
            return joined.regressor(ws, (trig, q), rates, self.parameter_count(), y);
        }
        set(y, S::zero());
        regressor::regressor(self, self.parameter_count(), ws, trig, q, rates, y);
    }
    fn regressor_products(
        &self,
        ws: &mut Workspace<S>,
        trig: &[(S, S)],
        q: &[S],
        [v, v_r, a_r]: [&[S]; 3],
        (pi, y_pi): (&[S], &mut [S]),
        (s, yt_s): (&[S], &mut [S]),
    ) {
        if let Some(joined) = Joined::of(self) {
            return joined.regressor_products(ws, (trig, q), [v, v_r, a_r, s], pi, y_pi, yt_s);
        }
        regressor::regressor_products(self, &mut ws.links, trig, q, [v, v_r, a_r], (pi, y_pi), (s, yt_s));
    }
    fn energy(&self, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S]) -> (S, S) {
        if let Some(joined) = Joined::of(self) {
            return joined.energy(ws, (trig, q), v);
        }
        energy::energy(self, &mut ws.poses, &mut ws.columns, trig, q, v)
    }
}
