"""The public names: all names of `CONTRACT` exist, and `dir(al)` has no accidental names."""

from __future__ import annotations

import inspect
import types
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

# Public names that must not change, grouped by page.
ARMS = "load_urdf planar_pr planar_arm pendulum Arm"
PRIORITY = "solve_priority PrioritySolver diagnose_priority Task"
MOTIONS = "Hold Quintic BangBang Sinusoid"
PLANTS = "RigidArm ElasticArm VelocityArm"
LAWS = "Adaptive ComputedTorque PDGravity CartesianImpedance ElasticImpedance PriorityVelocity"
RUNS = "simulate simulate_batch equilibrium"
PLANS = "bang_bang_time torque_optimal_time time_path"
ERRORS = "ArmletError InputError ModelError SolveError FormatError InternalError"
CONTRACT = f"{ARMS} {PRIORITY} {MOTIONS} {PLANS} {PLANTS} {LAWS} {RUNS} {ERRORS}".split()

# Members of the classes. Members of results are checked on a result below, if the class itself lacks the attribute.
MEMBERS = {
    "Arm": "from_chain from_dh n joint_names frame_names parameters with_parameters report mass_matrix coriolis_matrix gravity bias "
    "inverse_dynamics forward_dynamics regressor pose pose_vector position jacobian jacobian_dot energy",
    "PrioritySolver": "solve for_arm",
    "Run": "plot save to_pandas",
}
RESULTS = {
    "run": "t q v tau estimate theta theta_dot status stats monitors plot save to_pandas",
    "batch": "t q v tau estimate status stats monitors",
    "priority": "v residuals ranks status",
    "diagnosis": "ranks stacked_rank projected_ranks overlap singular_values kind",
    "equilibrium": "q theta tau x residual reachable spurious stable eigenvalues",
    "bang_bang": "feasible t_min t_max a_min a_max reason hold_start hold_end",
    "optimum": "feasible t theta_switch t_switch certified_global best",
    "best": "t switches kind",
    "path": "duration margin reason",
}
# Arguments in order; those after "*" are keyword-only.
SIGNATURES = {
    "planar_pr": "A B C",
    "load_urdf": "path_or_xml * gravity root tip",
    "planar_arm": "lengths * masses coms inertias gravity",
    "pendulum": "inertia gravity_moment",
    "Quintic": "q0 q1 duration",
    "BangBang": "q0 q1 duration",
    "Sinusoid": "offset amplitude frequency phase",
    "ElasticArm": "arm stiffness motor_inertia",
    "Adaptive": "arm motion kp kd gamma * estimate",
    "ComputedTorque": "arm motion kp kd",
    "PDGravity": "arm target kp kd",
    "CartesianImpedance": "arm target stiffness damping * frame axes nullspace feedforward",
    "NullSpace": "q_d stiffness damping",
    "ElasticImpedance": "arm target stiffness damping joint_stiffness motor_inertia reduced_inertia * frame axes motor_damping "
    "damping_ratio",
    "PriorityVelocity": "arm tasks * method eps",
    "simulate": "plant law q0 * t_end dt v0 theta0 theta_dot0 method rtol atol sample_time record_every t_eval force force_frame tau_max "
    "monitors throw",
    "simulate_batch": "plant law q0 * threads keep",
    "equilibrium": "plant law force * q0",
    "solve_priority": "jacobians velocities * method eps rounding",
    "diagnose_priority": "jacobians * rounding",
    "bang_bang_time": "theta0 thetaf inertia gravity_moment tau_max",
    "torque_optimal_time": "theta0 thetaf inertia gravity_moment tau_max",
    "time_path": "arm path * tau_max v_max a_max",
}
# All other public names.
EXTENSIONS = set(al.__all__) - set(CONTRACT)


def results() -> dict[str, Any]:
    arm = models.PR
    law = al.Adaptive(arm, al.Hold([0.1, 0.2]), 40.0, 20.0, 5.0)
    chain = models.TWO_LINKS
    elastic = al.ElasticArm(chain, 500.0, 0.4)
    soft = al.ElasticImpedance(chain, [0.5, 0.5], 300.0, 40.0, 500.0, 0.4, 0.02, frame="link2", axes="xy")
    levels = [np.eye(2, 3), np.eye(1, 3, 2)]
    optimum = al.torque_optimal_time(0.0, 1.0, 1.0, 0.5, 1.0)
    return {
        "run": al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=0.01, dt=1e-3),
        "batch": al.simulate_batch(al.RigidArm(arm), law, np.zeros((2, 2)), t_end=0.01, dt=1e-3),
        "priority": al.solve_priority(levels, [np.zeros(2), np.zeros(1)]),
        "diagnosis": al.diagnose_priority(levels),
        "equilibrium": al.equilibrium(elastic, soft, [0.0, 0.0], q0=[0.3, 1.0]),
        "bang_bang": al.bang_bang_time(0.0, 1.0, 1.0, 0.5, 1.0),
        "optimum": optimum,
        "best": optimum.best,
        "path": al.time_path(chain, [[0.0, 0.0], [0.5, 0.5]], tau_max=50.0),
    }


def test_contract_is_there() -> None:
    assert [name for name in CONTRACT if name not in dir(al)] == []


@pytest.mark.parametrize("name", MEMBERS)
def test_members(name: str) -> None:
    assert [member for member in MEMBERS[name].split() if not hasattr(getattr(al, name), member)] == []


def test_results() -> None:
    found = results()
    missing = [f"{what}.{name}" for what, names in RESULTS.items() for name in names.split() if not hasattr(found[what], name)]
    assert missing == []


@pytest.mark.parametrize("name", SIGNATURES)
def test_signature(name: str) -> None:
    """The positional arguments of the contract come first and in order. Its keyword arguments exist. Further arguments are extensions."""
    parameters = inspect.signature(getattr(al, name)).parameters.values()
    positional = [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.POSITIONAL_ONLY)]
    first, _, last = SIGNATURES[name].partition("*")
    assert positional[: len(first.split())] == first.split()
    assert set(last.split()) <= {p.name for p in parameters if p.kind is not p.POSITIONAL_ONLY}


def test_dir_is_the_set_of_names() -> None:
    """`dir(al)` has no modules, no helpers and only documented names. Classes begin with a capital letter, functions with a small one."""
    assert dir(al) == sorted(al.__all__)
    assert [name for name in al.__all__ if isinstance(getattr(al, name), types.ModuleType)] == []
    assert [name for name in al.__all__ if name.startswith("_")] == ["__version__"]
    for name in EXTENSIONS - {"__version__"}:
        thing = getattr(al, name)
        assert name[0].isupper() == inspect.isclass(thing), name
        assert (inspect.getdoc(thing) or "").strip(), name
