"""M(q) a + C(q, v) v + g(q) = tau as CasADi expressions, for chains and trees on a fixed base. `generated_c.py` compiles them as C.

Newton-Euler sweeps run in the joint frames. Composite bodies give the mass matrix. The factorisation M = L' D L keeps the zeros of a tree
(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5, 6 and 8). One sweep computes the Slotine-Li form M a_r + C(q, v) v_r + g
with the Christoffel matrix C. Composite bodies give C itself (Echeandia and Wensing, 2021). The arm's parameters are constants of the
expressions, and those that are zero disappear. So the C of a planar arm has planar equations. Only the description of the arm comes from
armlet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from generated_tree import Joint, Tree, snap

# A spatial vector (angular part, linear part), in the frame of a body at the origin of that frame.
Spatial = tuple[Any, Any]


def constant(values: Any) -> Any:
    """A constant CasADi matrix that does not store its zeros, so that expressions omit their products."""
    return ca.sparsify(ca.SX(ca.DM(snap(values))))


def cross(a: Any, b: Any) -> Any:
    return ca.vertcat(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def skew(a: Any) -> Any:
    return ca.vertcat(ca.horzcat(0, -a[2], a[1]), ca.horzcat(a[2], 0, -a[0]), ca.horzcat(-a[1], a[0], 0))


def add(a: Spatial, b: Spatial) -> Spatial:
    return a[0] + b[0], a[1] + b[1]


def scaled(a: Spatial, by: Any) -> Spatial:
    return a[0] * by, a[1] * by


def motion_cross(a: Spatial, b: Spatial) -> Spatial:
    """The cross product a x b of two spatial velocities."""
    return cross(a[0], b[0]), cross(a[1], b[0]) + cross(a[0], b[1])


def force_cross(a: Spatial, f: Spatial) -> Spatial:
    """The cross product a x* f of a spatial velocity and a spatial force."""
    return cross(a[0], f[0]) + cross(a[1], f[1]), cross(a[0], f[1])


def power(a: Spatial, f: Spatial) -> Any:
    return ca.dot(a[0], f[0]) + ca.dot(a[1], f[1])


@dataclass
class Body:
    """Mass (kg), first moment (kg m) and inertia (kg m^2) of a body about the origin of its frame."""

    mass: Any
    moment: Any
    inertia: Any

    @staticmethod
    def of(phi: Any) -> Body:
        rows = ((4, 5, 7), (5, 6, 8), (7, 8, 9))
        return Body(phi[0], phi[1:4], ca.vertcat(*(ca.horzcat(*(phi[k] for k in row)) for row in rows)))

    def times(self, a: Spatial) -> Spatial:
        return self.inertia @ a[0] + cross(self.moment, a[1]), self.mass * a[1] - cross(self.moment, a[0])

    def plus(self, other: Body) -> Body:
        return Body(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)

    def moved(self, rotation: Any, p: Any) -> Body:
        """The body's parameters in another frame, in which the present frame has the placement `(rotation, p)`."""
        h = rotation @ self.moment
        shift = (2 * ca.dot(h, p) + self.mass * ca.dot(p, p)) * ca.SX.eye(3) - (p @ h.T + h @ p.T + self.mass * (p @ p.T))
        return Body(self.mass, h + self.mass * p, rotation @ self.inertia @ rotation.T + shift)

    def matrix(self) -> Any:
        h = skew(self.moment)
        return ca.sparsify(ca.vertcat(ca.horzcat(self.inertia, h), ca.horzcat(-h, self.mass * ca.SX.eye(3))))


class Expressions:
    """Expressions of one configuration: sines, cosines and placements, computed once, and the functions of the arm that use them."""

    def __init__(self, tree: Tree, q: Any) -> None:
        self.tree, self.n, self.q = tree, tree.n, q
        self.parents = [joint.parent for joint in tree.joints]
        self.placements = [self._placement(joint, q[i]) for i, joint in enumerate(tree.joints)]
        self.axes: list[Spatial] = [self._axis(joint) for joint in tree.joints]
        self.bodies = [Body.of(constant(joint.phi)) for joint in tree.joints]

    @staticmethod
    def _placement(joint: Joint, q: Any) -> tuple[Any, Any]:
        rotation, offset = constant(joint.rotation), constant(joint.offset)
        if joint.prismatic:
            return rotation, offset + constant(joint.rotation @ joint.axis) * q
        k = np.array(skew(ca.DM(joint.axis)))
        return rotation @ (constant(np.eye(3) + k @ k) - ca.cos(q) * constant(k @ k) + ca.sin(q) * constant(k)), offset

    @staticmethod
    def _axis(joint: Joint) -> Spatial:
        nothing, axis = ca.SX(3, 1), constant(joint.axis)
        return (nothing, axis) if joint.prismatic else (axis, nothing)

    def into(self, i: int, a: Spatial) -> Spatial:
        """Transform a motion from the frame of the parent to the frame of body i."""
        rotation, p = self.placements[i]
        return rotation.T @ a[0], rotation.T @ (a[1] + cross(a[0], p))

    def out_of(self, i: int, f: Spatial) -> Spatial:
        """Transform a force from the frame of body i to the frame of the parent."""
        rotation, p = self.placements[i]
        linear = rotation @ f[1]
        return rotation @ f[0] + cross(p, linear), linear

    def torques(self, forces: list[Spatial]) -> Any:
        """Joint torques (n,) from the forces on the bodies: the joint axis times the sum of the forces on all bodies behind the joint."""
        carried, tau = list(forces), [ca.SX(0)] * self.n
        for i in reversed(range(self.n)):
            tau[i] = power(self.axes[i], carried[i])
            if self.parents[i] >= 0:
                carried[self.parents[i]] = add(carried[self.parents[i]], self.out_of(i, carried[i]))
        return ca.vertcat(*tau)

    def inverse_dynamics(self, v: Any, a: Any, armature: bool = True) -> Any:
        """Torque M a + C v + g, (n,)."""
        still, up = (ca.SX(3, 1), ca.SX(3, 1)), (ca.SX(3, 1), constant(-self.tree.gravity))
        velocities: list[Spatial] = []
        accelerations: list[Spatial] = []
        forces: list[Spatial] = []
        for i, (parent, axis) in enumerate(zip(self.parents, self.axes, strict=True)):
            moving = scaled(axis, v[i])
            w = add(self.into(i, velocities[parent] if parent >= 0 else still), moving)
            d = add(add(self.into(i, accelerations[parent] if parent >= 0 else up), scaled(axis, a[i])), motion_cross(w, moving))
            velocities.append(w)
            accelerations.append(d)
            forces.append(add(self.bodies[i].times(d), force_cross(w, self.bodies[i].times(w))))
        return self.torques(forces) + (constant(self.tree.armature) * a if armature else 0)

    def slotine_li(self, v: Any, v_r: Any, a_r: Any, phis: list[Any]) -> Any:
        """M a_r + C(q, v) v_r + g with the Christoffel matrix C and the inertial parameters `phis` of the bodies, without the motors."""
        still, up = (ca.SX(3, 1), ca.SX(3, 1)), (ca.SX(3, 1), constant(-self.tree.gravity))
        moving: list[Spatial] = []
        wanted: list[Spatial] = []
        accelerations: list[Spatial] = []
        forces: list[Spatial] = []
        for i, (parent, axis) in enumerate(zip(self.parents, self.axes, strict=True)):
            body, on_base = Body.of(phis[i]), parent < 0
            w = add(self.into(i, still if on_base else moving[parent]), scaled(axis, v[i]))
            w_r = add(self.into(i, still if on_base else wanted[parent]), scaled(axis, v_r[i]))
            d = add(self.into(i, up if on_base else accelerations[parent]), scaled(axis, a_r[i]))
            d = add(d, motion_cross(w, scaled(axis, v_r[i])))
            # B(v) v_r = (v x* I v_r + v_r x* I v - I (v x v_r)) / 2
            turning = add(force_cross(w, body.times(w_r)), force_cross(w_r, body.times(w)))
            turning = add(turning, scaled(body.times(motion_cross(w, w_r)), -1))
            moving.append(w)
            wanted.append(w_r)
            accelerations.append(d)
            forces.append(add(body.times(d), scaled(turning, 0.5)))
        return self.torques(forces)

    def composites(self) -> list[Body]:
        """For each joint, all bodies behind it, combined into one body."""
        composite = list(self.bodies)
        for i in reversed(range(self.n)):
            if self.parents[i] >= 0:
                composite[self.parents[i]] = composite[self.parents[i]].plus(composite[i].moved(*self.placements[i]))
        return composite

    def mass_entries(self) -> dict[tuple[int, int], Any]:
        """Entries M[i, j] for each i and its ancestors j, motors included. The other entries of the lower triangle are zero."""
        entries, composite = {}, self.composites()
        for i in range(self.n):
            force, j = composite[i].times(self.axes[i]), i
            entries[i, i] = power(self.axes[i], force) + float(self.tree.armature[i])
            while self.parents[j] >= 0:
                force, j = self.out_of(j, force), self.parents[j]
                entries[i, j] = power(self.axes[j], force)
        return entries

    def mass_matrix(self) -> Any:
        matrix = ca.SX(self.n, self.n)
        for (i, j), entry in self.mass_entries().items():
            matrix[i, j] = matrix[j, i] = entry
        return matrix

    def ancestors(self, i: int) -> list[int]:
        found = []
        while (i := self.parents[i]) >= 0:
            found.append(i)
        return found

    def forward_dynamics(self, v: Any, tau: Any) -> Any:
        """Acceleration a = M^-1 (tau - C v - g), (n,), with M = L' D L."""
        factor, solution = self.mass_entries(), ca.vertsplit(tau - self.inverse_dynamics(v, ca.SX(self.n, 1), armature=False))
        above = [self.ancestors(i) for i in range(self.n)]
        for k in reversed(range(self.n)):
            inverse = 1 / factor[k, k]
            for i in above[k]:
                ratio = factor[k, i] * inverse
                for j in [i, *above[i]]:
                    factor[i, j] = factor[i, j] - ratio * factor[k, j]
                factor[k, i] = ratio
                solution[i] = solution[i] - ratio * solution[k]
            solution[k] = solution[k] * inverse
        for k in range(self.n):
            for i in above[k]:
                solution[k] = solution[k] - factor[k, i] * solution[i]
        return ca.vertcat(*solution)

    def position(self, link: str) -> tuple[Any, list[tuple[int, Any, Any]]]:
        """World position of a link's origin; and, for each joint that moves the link, its index, world rotation and world origin."""
        last, _, offset = self.tree.attachment(link)
        path = [*reversed(self.ancestors(last)), last] if last >= 0 else []
        rotation, p, joints = ca.SX.eye(3), ca.SX(3, 1), []
        for i in path:
            p, rotation = p + rotation @ self.placements[i][1], rotation @ self.placements[i][0]
            joints.append((i, rotation, p))
        return p + rotation @ constant(offset), joints

    def jacobian(self, link: str) -> Any:
        """Jacobian (6, n) of a link's origin in world axes: [v; w] = J v."""
        tip, joints = self.position(link)
        matrix = ca.SX(6, self.n)
        for i, rotation, p in joints:
            angular, linear = (rotation @ part for part in self.axes[i])
            matrix[:, i] = ca.vertcat(linear + cross(angular, tip - p), angular)
        return matrix

    def coriolis_matrix(self, v: Any) -> Any:
        """The Christoffel matrix C, column by column, from composite bodies and their B = (v x* I + (I v) x - I v x) / 2."""
        moving: list[Spatial] = []
        for i, parent in enumerate(self.parents):
            before = moving[parent] if parent >= 0 else (ca.SX(3, 1), ca.SX(3, 1))
            moving.append(add(self.into(i, before), scaled(self.axes[i], v[i])))
        inertias, matrix = self.composites(), ca.SX(self.n, self.n)
        turning = [_turning(body, w) for body, w in zip(self.bodies, moving, strict=True)]
        for j in reversed(range(self.n)):
            axis, rate = self.axes[j], motion_cross(moving[j], self.axes[j])
            column = add(inertias[j].times(rate), _split(turning[j] @ ca.vertcat(*axis)))
            row = _split(turning[j].T @ ca.vertcat(*axis))
            momentum = inertias[j].times(axis)
            matrix[j, j] = power(axis, column)
            i = j
            while self.parents[i] >= 0:
                column, row, momentum = (self.out_of(i, force) for force in (column, row, momentum))
                i = self.parents[i]
                matrix[i, j] = power(self.axes[i], column)
                matrix[j, i] = power(motion_cross(moving[i], self.axes[i]), momentum) + power(self.axes[i], row)
            if self.parents[j] >= 0:
                rotation, p = self.placements[j]
                to = ca.sparsify(ca.vertcat(ca.horzcat(rotation.T, ca.SX(3, 3)), ca.horzcat(-rotation.T @ skew(p), rotation.T)))
                turning[self.parents[j]] = turning[self.parents[j]] + to.T @ turning[j] @ to
        return matrix


def _split(six: Any) -> Spatial:
    return six[:3], six[3:]


def _turning(body: Body, w: Spatial) -> Any:
    """The matrix B(v), 6 x 6, of one body. B v_r is the velocity-dependent force that `slotine_li` adds."""
    angular, linear = body.times(w)
    inertia, nothing = body.matrix(), ca.SX(3, 3)
    motion = ca.vertcat(ca.horzcat(skew(w[0]), nothing), ca.horzcat(skew(w[1]), skew(w[0])))
    momentum = ca.vertcat(ca.horzcat(skew(angular), skew(linear)), ca.horzcat(skew(linear), nothing))
    return ca.sparsify(0.5 * (-motion.T @ inertia - momentum - inertia @ motion))
