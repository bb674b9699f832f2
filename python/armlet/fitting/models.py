"""`fit_log`: the models that it accepts, and the fit of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from .. import _core
from ..arguments import choice, entries, instance, number, positive, shown
from ..border import border
from ..errors import InputError
from ..friction_models import StickSlip
from ..logs.log import Log
from ..run.sampling import Sampling, period_of
from ..scenario.changes import plain
from ..scenario.scenario import Scenario
from .columns import KINDS
from .fit import LogFit
from .inverse import inverse_fit
from .law_torques import with_torques_of
from .predicted import KINDS as PLANT_KINDS
from .predicted import predicted_fit
from .samples import NAME

__all__ = ["fit_log"]

#: Largest number of alternating projections, and relative error of the base parameters at which they end.
PROJECTIONS, CLOSE = 500, 1e-4

Model: TypeAlias = _core.Arm | _core.Plant | tuple[_core.Plant, _core.Law] | Scenario


@border
def fit_log(
    model: Model,
    log: Log,
    names: Sequence[str] = ("inertia", "rotors", "viscous", "coulomb", "offsets"),
    *,
    cutoff: float | None = None,
    stribeck_speed: float = 0.1,
    consistent: bool = False,
    delay: float | None = None,
    held: bool | None = None,
) -> LogFit:
    """Fit the parameters of an arm, a plant or a scenario to a log.

    For an arm, the measured torques are fitted (inverse fit). Positions and torques pass the same filter without phase, and velocities and
    accelerations are derivatives of the filtered positions. Gaps of the log, and both ends, are omitted.

    For a plant, the recorded torques drive the plant, and an observer predicts each position from the positions before it (prediction
    fit). The predictions' errors are minimised with their exact derivatives. This fit also has the numbers of elastic joints. The law does
    not change. If the log has no torques, the law computes them from the recorded positions and velocities. Samples at which a joint with
    Coulomb friction may stick are omitted.

    Args:
        model: an arm, a plant, a pair `(plant, law)`, or a `Scenario`. Parameters that are not fitted keep its values.
        log: the log, with torques; or with positions and velocities at the samples of a law without a state.
        names: kinds of parameters: "inertia" (base parameters), "rotors", "viscous" and "coulomb" friction, and "offsets" of the torques.
            Errors of sensors: "torque_constants" (factors of the recorded torques), "encoder_offsets", and one of "delay" and
            "clock_offset". For an arm also "stribeck" friction, for a plant "stiffness" and "joint_damping" of elastic joints.
        cutoff: cutoff frequency of the filter, Hz; the smaller of 10 Hz and a tenth of the sample rate if None (keyword only). The
            prediction fit only filters the velocity whose sign is that of Coulomb friction.
        stribeck_speed: `v_s` of "stribeck", rad/s or m/s (keyword only).
        consistent: whether the inertial parameters of `fit.model` are projected on physically possible ones (keyword only). Then the other
            parameters are fitted again.
        delay: time from the record of a torque to its effect, s (keyword only); None: that of the scenario's `Sampling`, else 0. "delay"
            and "clock_offset" start at this value. A record of the acting torque, such as that of a `Run`, has a negative delay.
        held: whether the torque is constant between its records, as that of a sampled law, or linear (keyword only). None: constant, unless
            the scenario has no `sample_time`. The inverse fit does not use it.

    Returns:
        A `LogFit`: `.values`, `.deviations`, `.refuted`, `.unidentifiable`, `.correlated`, `.model`, `.residuals`.

    Raises:
        InputError: an argument is not valid, the arm has no links, the log does not determine the torques, or it is too short.

    Source: [gautier1992exciting] for arms, [Ljung1999] for plants; docs/fit.md.

    >>> import numpy as np
    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> t = np.arange(0.0, 20.0, 0.005)
    >>> q, v, a = al.Sinusoid([0.0, 0.0], [1.0, 1.2], [1.3, 2.1], [0.0, 1.0])(t)
    >>> tau = arm.with_drives(damping=[0.8, 0.5]).inverse_dynamics(q, v, a, friction=True)
    >>> log = al.Log(t, q, tau=tau, names=arm.joint_names)
    >>> fit = al.fit_log(arm, log, ("inertia", "viscous"))
    >>> fit.model.limits["damping"].round(3)
    array([0.8, 0.5])
    >>> al.fit_log(al.RigidArm(arm), log, ("inertia", "viscous"), held=False).arm.limits["damping"].round(3)
    array([0.8, 0.5])
    """
    plant, law, arguments = _parts(model)
    loop = arguments.get("sample_time")
    arm = model if isinstance(model, _core.Arm) else plant.arm
    if not arm.frame_names:
        expected = 'an arm of joints and links, such as al.load_urdf(al.example_urdf("planar_pr"))'
        raise InputError(f"{NAME}: model has no links: expected {expected}, got an arm of planar_pr")
    record = instance(NAME, "log", log, Log, "an armlet.Log")
    known = KINDS if plant is None else PLANT_KINDS
    kinds = tuple(choice(NAME, "names", each, known) for each in entries(NAME, "names", names, 100))
    if not kinds or len(set(kinds)) < len(kinds):
        raise InputError(f"{NAME}: names are not different: expected at least one kind, each once, got {list(kinds)}")
    if record.n != arm.n or (record.tau is None and plant is None):
        found = "no torques" if record.tau is None else f"{record.n} joints"
        raise InputError(f"{NAME}: log does not fit the model: expected torques of {arm.n} joints, got {found}")
    if record.tau is None:
        record = with_torques_of(law, arguments, record)
    speed = positive(NAME, "stribeck_speed", stribeck_speed)
    instance(NAME, "consistent", consistent, bool, "True or False")
    late = number(NAME, "delay", _delay(loop) if delay is None else delay)
    if not math.isfinite(late):
        raise InputError(f"{NAME}: delay is not finite: expected a finite number, got {late}")
    frequency = None if cutoff is None else positive(NAME, "cutoff", cutoff)
    if held is not None:
        instance(NAME, "held", held, bool, "True, False or None")
    if plant is None:
        return inverse_fit(arm, record, kinds, frequency, speed, consistent, late)
    constant = bool(period_of(loop)) or not isinstance(model, Scenario) if held is None else held

    def changed(fitted: _core.Plant, moved: float) -> Any:
        if isinstance(model, Scenario):
            return _scenario(model, fitted, moved if "delay" in kinds else None)
        return (fitted, model[1]) if isinstance(model, tuple) else fitted

    return predicted_fit(plant, record, kinds, frequency, speed, consistent, late, constant, changed)


def _parts(model: Any) -> tuple[Any, Any, Mapping[str, Any]]:
    """The plant and the law of a model, None for those that it does not have, and the arguments of `simulate` in a scenario."""
    if isinstance(model, _core.Arm):
        return None, None, {}
    if isinstance(model, _core.Plant):
        return model, None, {}
    if isinstance(model, Scenario):
        return model.build()
    if isinstance(model, tuple) and len(model) == 2 and isinstance(model[0], _core.Plant) and isinstance(model[1], _core.Law):
        return model[0], model[1], {}
    raise InputError(f"{NAME}: model is of the wrong type: expected an arm, a plant, a (plant, law) or a Scenario, got {shown(model)}")


def _delay(loop: Any) -> float:
    return loop.delay if isinstance(loop, Sampling) else 0.0


def _scenario(scenario: Scenario, plant: Any, delay: float | None) -> Scenario:
    """The scenario with the fitted plant. The law keeps its model of the arm."""
    data = plain(scenario.data)
    data.setdefault("model", data["arm"])
    data["arm"] = _arm_table(_possible(plant.arm))
    given: Mapping[str, Any] = {name: value for name, value in plant.__getnewargs_ex__()[1].items() if name != "arm"}
    table = {name: _friction_table(value) if isinstance(value, StickSlip) else value for name, value in given.items() if value is not None}
    data["plant"] = {"kind": type(plant).__name__} | plain(table)
    run = data["run"]
    if delay is not None and period_of(scenario.build().arguments.get("sample_time")):
        sampling = run["sample_time"] if isinstance(run["sample_time"], dict) else {"period": run["sample_time"]}
        step = run.get("dt") or sampling["period"]
        # A method with fixed steps accepts a delay that is a multiple of the step.
        run["sample_time"] = sampling | {"delay": max(0.0, step * round(delay / step) if "dt" in run else delay)}
    return Scenario(data, scenario.folder, scenario.name)


def _arm_table(arm: _core.Arm) -> dict[str, Any]:
    gravity: Any = arm.gravity_vector
    return {"kind": "urdf", "xml": arm.to_urdf()[0], "gravity": [0.0, 0.0, 0.0] if gravity is None else list(map(float, gravity))}


def _possible(arm: _core.Arm) -> _core.Arm:
    """The arm with physically possible bodies, which a robot file requires, and with nearly the same base parameters.

    Projections on the possible parameters and on those with these base parameters alternate.
    """
    if arm.check_parameters().consistent:
        return arm
    rows = arm.base_parameters().projection
    target, back, pi = rows @ arm.parameters, np.linalg.pinv(rows), arm.parameters
    for _ in range(PROJECTIONS):
        pi = arm.project_parameters(pi)
        miss = target - rows @ pi
        if np.linalg.norm(miss) <= CLOSE * np.linalg.norm(target):
            break
        pi = pi + back @ miss
    return arm.with_parameters(arm.project_parameters(pi))


def _friction_table(friction: StickSlip) -> dict[str, Any]:
    given = friction.__getnewargs_ex__()[1]
    return {"kind": "StickSlip"} | {name: value for name, value in given.items() if value is not None}
