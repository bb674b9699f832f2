"""The tables of a scenario: the kinds of arms, plants, motions and laws, and the keys of each kind.

A plant or law of the extension is available in scenario files if each of its parameters has a field here. Arms, motions, and classes whose
table differs from the constructor are declared explicitly.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import _core
from ..errors import InputError, ModelError
from ..excitation import exciting_motion
from ..friction_models import LuGre, StickSlip
from ..run.events import JointStops
from ..run.sampling import CHANNELS, Sampling, TorqueSensor
from ..samples import stated_samples
from .derived import classes_of, derived
from .fields import Entries, Field, Flag, FlagOrNames, Integer, Items, Keyed, Kind, Names, Numbers, OneOf, Table, Text, Values
from .guarded import with_guarded
from .impedance import following, impedance, options, target_of
from .paths import POSES, timed_path
from .tasks import prioritised, tasks_of

__all__ = ["ARMS", "KNOWN", "LAWS", "MOTIONS", "PLANTS", "RUN", "SCENARIO", "SWEEP", "arguments"]

NUMBER = Numbers()
POSITIVE = Numbers(low=0.0, strict=True)
NOT_NEGATIVE = Numbers(low=0.0)
VECTOR = Numbers(depth=1, scalar=False)
POSITIVES = Numbers(depth=1, scalar=False, low=0.0, strict=True)
ROWS = Numbers(depth=2, scalar=False)
GAIN = Numbers(depth=2, low=0.0, strict=True)
DAMPING = Numbers(depth=2, low=0.0)
TEXT = Text()
EACH_POSITIVE = Numbers(depth=1, low=0.0, strict=True)
EACH = Numbers(depth=1)
ALONG = Numbers(depth=2, scalar=False, low=0.0, strict=True)


def _urdf(path: str | None = None, xml: str | None = None, **keywords: Any) -> _core.Arm:
    if (path is None) == (xml is None):
        raise InputError("urdf: path is missing: expected either path, or xml with the text of the robot file")
    try:
        return _core.load_urdf(path or xml or "", **keywords)
    except ModelError:
        raise
    except InputError as error:
        raise InputError(str(error).replace("path_or_xml", "xml" if path is None else "path", 1)) from None


def _example(name: str, **keywords: Any) -> _core.Arm:
    return _core.load_urdf(_core.example_urdf(name), **keywords)


_PAYLOAD = Table({"frame": TEXT, "mass": NOT_NEGATIVE, "com": VECTOR, "inertia": ROWS}, ("frame", "mass"))


def _arm(keys: Mapping[str, Field], required: tuple[str, ...], make: Any) -> Kind:
    """A kind of arm with frames. Its table may have a payload."""

    def arm(payload: Mapping[str, Any] | None = None, **keywords: Any) -> _core.Arm:
        made: _core.Arm = make(**keywords)
        return made if payload is None else made.with_payload(**payload)

    return Kind(dict(keys) | {"payload": _PAYLOAD}, required, arm)


_TREE: dict[str, Field] = {"gravity": VECTOR, "root": TEXT, "tip": TEXT, "mimic": Text(("joined", "independent"))}
_JOINT = Table(
    {
        "type": Text(("R", "P", "F", "revolute", "continuous", "prismatic", "fixed")),
        "axis": VECTOR,
        "rpy": VECTOR,
        "xyz": VECTOR,
        "phi": VECTOR,
        "parent": Integer(-1),
        "name": TEXT,
        "lower": Numbers(finite=False),
        "upper": Numbers(finite=False),
        "velocity": Numbers(low=0.0, finite=False),
        "effort": Numbers(low=0.0, finite=False),
        "armature": NOT_NEGATIVE,
        "damping": NOT_NEGATIVE,
        "friction": NOT_NEGATIVE,
        "mimic": Table({"joint": Integer(0), "multiplier": NUMBER, "offset": NUMBER}, ("joint",)),
    },
    ("type",),
)

ARMS = OneOf(
    {
        "planar_pr": Kind({"A": POSITIVE, "B": NUMBER, "C": POSITIVE}, ("A", "B", "C"), _core.planar_pr),
        "planar_arm": _arm(
            {"lengths": POSITIVES, "masses": POSITIVES, "coms": VECTOR, "inertias": VECTOR, "gravity": VECTOR},
            ("lengths",),
            _core.planar_arm,
        ),
        "pendulum": Kind({"inertia": POSITIVE, "gravity_moment": NUMBER}, ("inertia", "gravity_moment"), _core.pendulum),
        "urdf": _arm({"path": TEXT, "xml": TEXT, **_TREE}, (), _urdf),
        "example": _arm({"name": TEXT, **_TREE}, ("name",), _example),
        "chain": _arm({"joints": Items(_JOINT), "gravity": VECTOR}, ("joints",), _core.Arm.from_chain),
    }
)

_WALL = Table(
    {"frame": TEXT, "point": VECTOR, "normal": VECTOR, "stiffness": POSITIVE, "damping": NOT_NEGATIVE},
    ("frame", "point", "normal", "stiffness"),
)


_LIMIT = Numbers(depth=1, finite=False)
_STOPS = Table(
    {"stiffness": Numbers(depth=1, low=0.0, strict=True), "damping": Numbers(depth=1, low=0.0), "lower": _LIMIT, "upper": _LIMIT},
    ("stiffness",),
)


_CURVE: dict[str, Field] = dict.fromkeys(("coulomb", "static", "stribeck_speed", "viscous", "load_ratio"), Numbers(depth=1, low=0.0))
_FRICTION = OneOf(
    {
        "LuGre": Kind(
            _CURVE | {"stiffness": Numbers(depth=1, low=0.0, strict=True), "damping": Numbers(depth=1, low=0.0)},
            ("coulomb", "stiffness"),
            LuGre,
        ),
        "StickSlip": Kind(_CURVE, ("coulomb",), StickSlip),
    }
)


def _with_contacts(make: Any) -> Any:
    def plant(
        arm: _core.Arm, wall: Mapping[str, Any] | None = None, stops: Mapping[str, Any] | None = None, **keywords: Any
    ) -> _core.Plant:
        contacts = {"wall": wall and _core.Wall(**wall), "stops": stops and JointStops(**stops)}
        dry = {name: _FRICTION.make(value) for name, value in keywords.items() if isinstance(value, Mapping)}
        made: _core.Plant = make(arm, **keywords | dry, **{name: contact for name, contact in contacts.items() if contact})
        return made

    return plant


_PLANT: dict[str, Field] = {
    "friction": Entries({"plain": Flag(), "text": Text(("stick_slip",)), "table": _FRICTION}),
    **dict.fromkeys(("stiffness", "motor_inertia"), GAIN),
    "joint_damping": DAMPING,
    "motor_friction": Entries({"plain": DAMPING, "table": _FRICTION}),
    "wall": _WALL,
    "stops": _STOPS,
}
PLANTS = OneOf({each.__name__: derived(each, _PLANT, needs=("arm",), make=_with_contacts(each)) for each in classes_of(_core.Plant)})

MOTIONS = OneOf(
    {
        "Hold": Kind({"q": VECTOR}, ("q",), _core.Hold),
        "Quintic": Kind({"q0": VECTOR, "q1": VECTOR, "duration": POSITIVE}, ("q0", "q1", "duration"), _core.Quintic),
        "BangBang": Kind({"q0": VECTOR, "q1": VECTOR, "duration": POSITIVE}, ("q0", "q1", "duration"), _core.BangBang),
        "Sinusoid": Kind(
            {"offset": VECTOR, "amplitude": ROWS, "frequency": ROWS, "phase": ROWS},
            ("offset", "amplitude", "frequency", "phase"),
            _core.Sinusoid,
        ),
        "Table": Kind({"dt": POSITIVE, "q": ROWS, "v": ROWS, "a": ROWS, "start": NUMBER}, ("dt", "q", "v", "a"), _core.Table),
        "Spline": Kind(
            {"t": VECTOR, "q": ROWS, "v": ROWS, "a": ROWS, "spline": Text(("clamped", "natural", "not-a-knot"))}, ("t", "q"), _core.Spline
        ),
        "TimedPath": Kind(
            {"path": Entries({"plain": ROWS, "table": POSES}), "stops": Numbers(1, False, 0.0), "frame": TEXT}
            | dict.fromkeys(("q_min", "q_max"), EACH)
            | dict.fromkeys(("tip_speed", "tip_acceleration"), EACH_POSITIVE)
            | dict.fromkeys(("tau_max", "v_max", "a_max"), ALONG),
            ("path",),
            timed_path,
            ("arm",),
        ),
        "ExcitingMotion": Kind(
            {
                "duration": POSITIVE,
                "limits": Table({"q_min": Numbers(1), "q_max": Numbers(1)} | dict.fromkeys(("v_max", "a_max", "effort"), EACH_POSITIVE)),
                "harmonics": Integer(1),
                "samples": Integer(1),
                "noise": EACH_POSITIVE,
                "armature": Flag(),
                "friction": Flag(),
                "starts": Integer(1),
                "iterations": Integer(1),
                "seed": Integer(0),
            },
            ("duration",),
            exciting_motion,
            ("arm",),
        ),
    }
)

_TARGET: dict[str, Field] = {"target": VECTOR}
_REACHED = target_of(MOTIONS)
_OPTIONS = options(MOTIONS)
_PD: dict[str, Field] = {"kp": GAIN, "kd": GAIN}
_IMPEDANCE: dict[str, Field] = {"stiffness": GAIN, "damping": DAMPING}
_FRAME: dict[str, Field] = {"frame": TEXT, "axes": TEXT}
_SPRING: dict[str, Field] = {"joint_stiffness": GAIN}
_REDUCED: dict[str, Field] = {"reduced_inertia": GAIN}
_INNER: dict[str, Field] = _SPRING | {"motor_inertia": GAIN}
_INNER_OPTIONS: dict[str, Field] = {"motor_damping": DAMPING, "damping_ratio": POSITIVE, "relative_damping": Flag()}
_ARM, _FOLLOWS = ("arm",), ("arm", "motion")


def _law(make: Any, required: Mapping[str, Field], optional: Mapping[str, Field] | None = None, needs: tuple[str, ...] = _ARM) -> Kind:
    return Kind(dict(required) | dict(optional or {}), tuple(required), make, needs)


_TIP: dict[str, Field] = {"frame": TEXT}
_TASKS = tasks_of(MOTIONS)
_LEVELS: dict[str, Field] = {"tasks": Items(_TASKS)}
_METHOD: dict[str, Field] = {"method": Text(("clamp", "exact", "damped", "chiaverini", "sns")), "eps": Numbers(depth=1, low=0.0)}
_LIMITS = ("v_min", "v_max", "q_min", "q_max")
_BOUNDS: dict[str, Field] = {
    **dict.fromkeys(_LIMITS, Numbers(depth=1)),
    "a_max": Numbers(depth=1, low=0.0, strict=True),
    "horizon": POSITIVE,
    "limits": Flag(),
}
_REST: dict[str, Field] = {"joint_damping": NOT_NEGATIVE, "tau_max": Numbers(depth=1, low=0.0, strict=True, finite=False)}
_ADAPTATION: dict[str, Field] = {
    "estimate": VECTOR,
    "friction": FlagOrNames(("viscous", "coulomb", "stribeck")),
    "armature": Flag(),
    "friction_speed": Numbers(depth=1, low=0.0, strict=True),
    "leakage": NOT_NEGATIVE,
    "leakage_form": Text(("sigma", "e")),
    "leakage_centre": VECTOR,
    "dead_zone": NOT_NEGATIVE,
    "composite": GAIN,
    "composite_rate": POSITIVE,
    "concurrent": Table({"W": Numbers(depth=3, scalar=False), "tau": ROWS}, ("W", "tau")),
    "concurrent_weight": GAIN,
    "offset": Flag(),
}
_FOLLOWED: dict[str, Field] = {"target": Entries({"plain": VECTOR, "table": MOTIONS})}
_PID: dict[str, Field] = {
    "ki": GAIN,
    "friction": Flag(),
    **dict.fromkeys(
        ("tau_max", "derivative_filter", "friction_speed", "observer_bandwidth", "nominal_inertia"), Numbers(depth=1, low=0.0, strict=True)
    ),
}


def _adaptive(arm: _core.Arm, motion: _core.Motion, concurrent: Mapping[str, Any] | None = None, **keywords: Any) -> _core.Law:
    """Make an `Adaptive` law. Samples for concurrent learning are a table with `W` and `tau`."""
    stored = None if concurrent is None else stated_samples(**concurrent)
    return _core.Adaptive(arm, motion, concurrent=stored, **keywords)


def _pid(arm: _core.Arm, target: Any, kp: Any, kd: Any, ki: Any = None, **options: Any) -> _core.Law:
    """Make a `PID` law, without an integral if `ki` is missing."""
    return _core.PID(arm, target, kp, ki, kd, **options)


#: Parameters of laws that a plant also has, with their names in the plant. If a law lacks one, the plant's value is used.
KNOWN = {"joint_stiffness": "stiffness", "motor_inertia": "motor_inertia"}

#: `Adaptive` and `ComputedTorque`, and laws whose tables differ from their constructors.
_SPECIAL = {
    "Adaptive": _law(_adaptive, _PD | {"gamma": GAIN}, _ADAPTATION, _FOLLOWS),
    "ComputedTorque": _law(_core.ComputedTorque, _PD, None, _FOLLOWS),
    "PID": _law(following(_pid, MOTIONS), _FOLLOWED | _PD, _PID),
    "CartesianImpedance": _law(impedance(_core.CartesianImpedance, MOTIONS), _REACHED | _IMPEDANCE | _TIP, _FRAME | _OPTIONS),
    "ElasticImpedance": _law(
        impedance(_core.ElasticImpedance, MOTIONS),
        _REACHED | _IMPEDANCE | _REDUCED | _TIP,
        _FRAME | _INNER | _INNER_OPTIONS | _OPTIONS,
    ),
    "ElasticTracking": _law(_core.ElasticTracking, _IMPEDANCE | _REDUCED | _TIP, _FRAME | _INNER | _INNER_OPTIONS, _FOLLOWS),
    "PriorityVelocity": _law(prioritised(_core.PriorityVelocity, _TASKS), _LEVELS, _METHOD | _BOUNDS),
    "PriorityAcceleration": _law(prioritised(_core.PriorityAcceleration, _TASKS), _LEVELS, _METHOD | _BOUNDS | _REST),
}
_PLAIN: dict[str, Field] = _TARGET | _PD | _IMPEDANCE | _REDUCED | _INNER | _INNER_OPTIONS
_PLAIN |= {"online": Flag(), "kt": DAMPING, "ks": DAMPING}
_KINDS = {
    each.__name__: derived(
        each, _PLAIN | ({} if each is _core.PDGravity else _FOLLOWED), needs=_FOLLOWS, known=KNOWN, make=following(each, MOTIONS)
    )
    for each in classes_of(_core.Law, (*_SPECIAL, "Guarded"))
}
LAWS = with_guarded(_SPECIAL | _KINDS)

_CHANNEL = Table({name: NOT_NEGATIVE for name in CHANNELS})
_TORQUE_SENSOR = Table(
    {
        "noise": NOT_NEGATIVE,
        "bias": Numbers(depth=1),
        "resolution": NOT_NEGATIVE,
        "bandwidth": Numbers(low=0.0, strict=True, finite=False),
    }
)
_SAMPLING = Table(
    {
        "period": POSITIVE,
        "delay": NOT_NEGATIVE,
        "jitter": NOT_NEGATIVE,
        "sensor_delay": Integer(),
        "noise": _CHANNEL,
        "resolution": _CHANNEL,
        "rate_limit": Numbers(low=0.0, strict=True, finite=False),
        "torque_sensor": _TORQUE_SENSOR,
        "seed": Integer(),
    },
    ("period",),
)
RUN = Table(
    {
        "q0": VECTOR,
        "v0": VECTOR,
        "theta0": VECTOR,
        "theta_dot0": VECTOR,
        "t_end": NOT_NEGATIVE,
        "method": Text(_core.METHODS),
        "dt": POSITIVE,
        "rtol": NOT_NEGATIVE,
        "atol": NOT_NEGATIVE,
        "max_step": POSITIVE,
        "sample_time": Entries({"plain": POSITIVE, "table": _SAMPLING}),
        "record_every": Integer(1),
        "t_eval": Entries({"plain": Numbers(1, False, 0.0), "table": Table({"step": POSITIVE}, ("step",))}),
        "force": Entries({"plain": VECTOR, "tables": Items(Table({"t": NOT_NEGATIVE, "force": VECTOR}, ("t", "force")))}),
        "force_frame": TEXT,
        "tau_max": Numbers(depth=1, low=0.0, strict=True),
        "monitors": Flag(),
        "state_limit": POSITIVE,
        "check_limits": Flag(),
        "sensitivity": Names(),
    },
    ("q0", "t_end"),
)

_PAIR = Numbers(1, False)
_VARY = Entries(
    {
        "plain": Values(),
        "table": Table({"linspace": _PAIR, "geomspace": _PAIR, "uniform": _PAIR, "log_uniform": _PAIR, "normal": _PAIR, "integers": _PAIR}),
    }
)
SWEEP = Table({"vary": Keyed(_VARY), "draws": Integer(1), "seed": Integer(), "chunk": Integer(1)}, ("vary",))
_CRITERION = Entries({"plain": TEXT, "table": Keyed(EACH_POSITIVE)})
WORST = Table(
    {"vary": Keyed(_VARY), "criterion": _CRITERION, "runs": Integer(8), "starts": Integer(1), "seed": Integer()}, ("vary", "criterion")
)

SCENARIO = Table(
    {
        "title": TEXT,
        "arm": ARMS,
        "model": ARMS,
        "plant": PLANTS,
        "motion": MOTIONS,
        "law": LAWS,
        "run": RUN,
        "sweep": SWEEP,
        "worst": WORST,
    },
    ("arm", "law", "run"),
)


# Largest number of records. Each record contains the whole state.
RECORDS = 10_000_000


def arguments(run: Mapping[str, Any]) -> dict[str, Any]:
    """The keyword arguments of `simulate` from the table `run`."""
    given = dict(run)
    sampling, times, force = given.get("sample_time"), given.get("t_eval"), given.get("force")
    if isinstance(sampling, Mapping):
        sensor = sampling.get("torque_sensor")
        given["sample_time"] = Sampling(**{**sampling, "torque_sensor": sensor and TorqueSensor(**sensor)})
    if isinstance(times, Mapping):
        records = run["t_end"] / times["step"]
        if records > RECORDS:
            raise InputError(f"simulate: t_eval is too fine: expected at most {RECORDS:,} records, got a step of {times['step']:g} s")
        given["t_eval"] = np.linspace(0.0, run["t_end"], max(2, round(records) + 1))
    if force and isinstance(force[0], Mapping):
        given["force"] = [(step["t"], step["force"]) for step in force]
    return given
