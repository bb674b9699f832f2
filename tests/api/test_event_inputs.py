"""Invalid arguments of events, stops, dense output and torque sensors raise an `InputError` with the expected value."""

from __future__ import annotations

import functools
from typing import Any

import models
import numpy as np
from refusals import refused

import armlet as al

ARM = models.TWO_LINKS
LAW = al.PDGravity(ARM, [0.3, 1.0], 50.0, 10.0)
PLANT = al.RigidArm(ARM)
ELASTIC = al.ElasticArm(ARM, [800.0, 500.0], [0.4, 0.25])
STATE = al.StateFeedback(ARM, [0.3, 1.0], 200.0, 20.0, 1.0, 0.02, [800.0, 500.0])
NAN, INF = float("nan"), float("inf")


def run(**options: Any) -> al.Run:
    return al.simulate(PLANT, LAW, [0.0, 0.5], **({"t_end": 0.1, "method": "dop853"} | options))


def test_fixed_steps_have_neither() -> None:
    for method in ("euler", "semi_implicit", "rk4", "ros2"):
        refused(functools.partial(run, method=method, dt=1e-3, events=al.Event.speed(0)), "simulate: events", "dop853", method)
        refused(functools.partial(run, method=method, dt=1e-3, dense=True), "simulate: dense", method)


def test_flags() -> None:
    for name in ("dense", "monitors"):
        for value in ("yes", 1, []):
            refused(functools.partial(run, **{name: value}), f"simulate: {name} is not a flag", "True or False")
    assert run(dense=np.True_, monitors=np.False_)


def test_events() -> None:
    for event, word in (
        (al.Event.joint(2, 0.5), "0 to 1"),
        (al.Event.joint(-1, 0.5), "0 to 1"),
        (al.Event.joint("wrist", 0.5), "wrist"),
        (al.Event.plane("hand", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]), "link2"),
        (al.Event.plane("link2", [0.0, 0.0], [1.0, 0.0, 0.0]), "(3,)"),
        (al.Event.contact(), "wall"),
        (al.Event.joint_stop(0, "upper"), "stop"),
    ):
        refused(functools.partial(run, events=[event]), "simulate", word)
    refused(lambda: run(events=[0.5]), "events", "float")
    refused(lambda: al.Event.speed(0, direction=NAN), "direction")
    refused(lambda: al.Event.speed(0, stop=-1), "stop")
    refused(lambda: al.Event.joint_stop(0, "middle"), "side")  # type: ignore[arg-type]  # an invalid argument
    refused(lambda: al.Event.function(3.0), "callable")  # type: ignore[arg-type]  # an invalid argument
    found = run(events=al.Event.joint(ARM.joint_names[0], 0.1)).events
    assert found is not None
    refused(lambda: found.of("other"), "joint")
    assert run(events=[]).events is None


def test_stops() -> None:
    for stops, word in (
        (al.JointStops(1e3), "no limit"),
        (al.JointStops(-1.0, upper=1.0), "stiffness"),
        (al.JointStops(1e3, -1.0, upper=1.0), "damping"),
        (al.JointStops(1e3, lower=1.0, upper=1.0), "lower"),
        (al.JointStops(1e3, upper=[1.0, 1.0, 1.0]), "(2,)"),
        (al.JointStops(1e3, upper=NAN), "upper is not a number"),
        (al.JointStops(1e3, lower=[-1.0, NAN], upper=1.0), "first bad index 1"),
        (al.JointStops([1e3, INF], upper=1.0), "stiffness"),
        (al.JointStops(1e3, [0.0, INF], upper=1.0), "damping"),
        (al.JointStops(1e3, lower=[-INF, INF], upper=INF), "lower"),
        (1e3, "JointStops"),
    ):
        refused(functools.partial(al.RigidArm, ARM, stops=stops), "RigidArm", word)
        refused(functools.partial(al.ElasticArm, ARM, 800.0, 0.4, stops=stops), "ElasticArm", word)


def test_stops_with_infinite_limits() -> None:
    """A joint without limits has no stop. The run equals one whose stop of that joint is far away."""
    finite = al.JointStops(1e3, 20.0, lower=[-1e6, -0.2], upper=[1e6, 1e6])
    for infinite in (
        al.JointStops(1e3, 20.0, lower=[-INF, -0.2], upper=INF),
        al.JointStops(1e3, 20.0, lower=[-INF, -0.2], upper=[INF, INF]),
        al.JointStops(1e3, 20.0, lower=np.array([-INF, -0.2]), upper=(INF, 1e9)),
    ):
        for plant in (al.RigidArm, functools.partial(al.ElasticArm, stiffness=800.0, motor_inertia=0.4)):
            law = LAW if plant is al.RigidArm else STATE
            q = [
                al.simulate(plant(ARM, stops=stops), law, [0.0, -0.3], t_end=0.05, dt=1e-3, monitors=False).q  # type: ignore[operator]  # either constructor
                for stops in (finite, infinite)
            ]
            # Stops that do not touch add zero. Only the order of sums may differ.
            np.testing.assert_allclose(q[1], q[0], rtol=0, atol=1e-12)


def test_torque_sensors() -> None:
    def sampled(sensor: Any, plant: Any = ELASTIC, law: Any = STATE, **effects: Any) -> al.Run:
        return al.simulate(plant, law, [0.3, 1.0], t_end=0.01, dt=1e-3, sample_time=al.Sampling(1e-3, torque_sensor=sensor, **effects))

    for sensor, word in (
        (al.TorqueSensor(noise=-1.0), "noise"),
        (al.TorqueSensor(bias=NAN), "bias"),
        (al.TorqueSensor(bias=[1.0, 2.0, 3.0]), "(2,)"),
        (al.TorqueSensor(resolution=INF), "resolution"),
        (al.TorqueSensor(bandwidth=0.0), "bandwidth"),
    ):
        refused(functools.partial(sampled, sensor), "simulate", word)
    refused(lambda: sampled(0.1), "Sampling: torque_sensor")
    refused(lambda: sampled(al.TorqueSensor(), PLANT, LAW), "elastic joints", "RigidArm")
    refused(lambda: sampled(al.TorqueSensor(), noise={"q": 0.1}), "torque_sensor")


def test_two_sources_of_damping() -> None:
    given = ARM, [0.5, 0.3], 300.0, 40.0, 800.0, 0.4, 0.02
    refused(
        lambda: al.ElasticImpedance(*given, frame="link2", axes="xy", motor_damping=8.0, damping_ratio=0.7),
        "ElasticImpedance: damping_ratio",
        "motor_damping",
    )
    refused(lambda: al.JointImpedance(ARM, [0.3, 1.0], 100.0, 10.0, 800.0, 0.4, 0.02, motor_damping=8.0, damping_ratio=0.7), "both")
