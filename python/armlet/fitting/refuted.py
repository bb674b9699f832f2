"""The refuted assumptions of a fit in words, with advice."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..logs.log import Log
from ..pickling import sealed
from .assumptions import Assumption, assumptions
from .columns import columns_of
from .evidence import Evidence
from .refutation import BLOCK_LAGS, LAGS, Finding, Residual, refute
from .samples import Samples, samples_of
from .sensors import Sensors

__all__ = ["Refuted", "refuted_by", "refuted_of"]

Array = NDArray[np.float64]

#: A residual below this share of the torque in every joint is not tested, because it can be an error of the filter.
EXACT = 1e-4


@sealed
@dataclass(frozen=True)
class Refuted:
    """An assumption that a log refutes, as `fit.refuted` lists it. `print` shows it in words.

    >>> import numpy as np
    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> q, v, a = al.Sinusoid([0.0, 0.0], [1.0, 1.2], [1.3, 2.1], [0.0, 1.0])(t)
    >>> noise = 0.1 * np.random.default_rng(0).normal(size=q.shape)
    >>> tau = arm.inverse_dynamics(q, v, a) + [0.5, 0.0] * np.sign(v) + noise
    >>> fit = al.fit_log(arm, al.Log(t, q, tau=tau, names=arm.joint_names), ["inertia"])
    >>> fit.refuted[0].name, fit.refuted[0].joint
    ('coulomb', 'joint1')
    """

    #: The assumption, such as "coulomb", "delay" or "gravity". docs/fit.md lists all names.
    name: str
    #: Name of the joint; None for the whole arm.
    joint: str | None
    #: Probability of a statistic of this size by chance, before Holm's correction, and the statistic: an F ratio.
    p_value: float
    statistic: float
    #: Share of the residual's sum of squares, of the joint or of the whole arm, that this assumption explains, or zero.
    share: float
    #: What was found, in words, and what to do.
    sentence: str
    advice: str

    def __str__(self) -> str:
        explained = f", explains {100.0 * self.share:.0f} % of the residual" if self.share > 0.0 else ""
        return f"{self.sentence} (p = {self.p_value:.1g}{explained}): {self.advice}"


def refuted_of(
    model: _core.Arm,
    log: Log,
    kinds: Sequence[str],
    speed: float,
    cutoff: float,
    sensors: Sensors,
    residual: Array,
) -> tuple[tuple[Refuted, ...], tuple[str, ...]]:
    """The refuted assumptions of a fit, and in words those that have the same torque as fitted parameters."""
    samples = sensors.corrected(samples_of(log, cutoff, sensors.delay))
    if len(residual) < 8:
        return (), ()
    explained = samples.tau - residual
    W = np.concatenate([columns_of(model, samples, kinds, speed)[0], sensors.columns(model, samples, kinds, explained)], axis=2)
    candidates = [each for each in assumptions(model, samples, kinds, speed, explained) if each.name not in sensors.replaced]
    return _judged(model, samples, Residual(W, residual, _noise(samples, residual), LAGS), candidates, log, sensors.delay)


def refuted_by(
    evidence: Evidence, log: Log, kinds: Sequence[str], speed: float, delay: float, residual: Array
) -> tuple[tuple[Refuted, ...], tuple[str, ...]]:
    """The same for a prediction fit."""
    if len(residual) < 8:
        return (), ()
    model, blocks = evidence.arm, evidence.blocks
    found = assumptions(model, blocks, kinds, speed, evidence.explained)
    candidates = [each for each in found if each.name not in evidence.untested]
    judged = Residual(evidence.columns, residual, _noise(blocks, residual), BLOCK_LAGS)
    return _judged(model, blocks, judged, candidates, log, delay)


def _floor(samples: Samples) -> float:
    torque = np.sqrt(np.mean(samples.tau**2, axis=0))
    return EXACT * max(float(torque.max(initial=0.0)), 1e-300)


def _noise(samples: Samples, residual: Array) -> Array:
    return np.asarray(np.maximum(np.sqrt(np.mean(residual**2, axis=0)), _floor(samples)))


def _judged(
    model: _core.Arm, samples: Samples, residual: Residual, candidates: Sequence[Assumption], log: Log, delay: float
) -> tuple[tuple[Refuted, ...], tuple[str, ...]]:
    exact = np.all(residual.noise <= _floor(samples))
    findings, hidden = refute(residual, candidates, samples.v)
    words = () if exact else tuple(_in_words(each, model, log, delay) for each in findings)
    lines = (f"not distinguishable from the fitted parameters: {_WHAT[each.name]}{_of(log, each.joint)}" for each in hidden)
    return words, tuple(lines)


#: What an assumption is about, for `unidentifiable`.
_WHAT = {
    "viscous": "viscous friction",
    "coulomb": "Coulomb friction",
    "stribeck": "Stribeck friction",
    "rotors": "rotor inertia",
    "offsets": "torque offset",
    "torque_constant": "torque constant",
    "saturation": "saturation of the torque",
    "jump": "a jump of the torque",
    "payload": "a payload that changes",
    "elasticity": "elasticity",
    "delay": "delay of the torques",
    "clock_drift": "drift of the clock of the torques",
    "gravity": "direction of gravity",
}


def _of(log: Log, joint: int | None) -> str:
    return "" if joint is None else f" of joint {log.names[joint]!r}"


def _in_words(finding: Finding, model: _core.Arm, log: Log, delay: float) -> Refuted:
    joint = None if finding.joint is None else log.names[finding.joint]
    turns = finding.joint is None or log.units[finding.joint] == "rad"
    size = finding.size[0] if len(finding.size) == 1 else math.nan
    numbers = {
        "size": size, "deviation": finding.deviation[0] if finding.deviation else math.nan, "value": finding.value,
        "unit": "N m" if turns else "N", "ratio": 1.0 + size, "missing": 100.0 * size,
        "stiffness": 1.0 / size if size else math.inf, "per": "N m/rad" if turns else "N/m", "delay": delay + size, "late": 1e3 * size,
        "drift": 1e3 * size, "tilt": _tilt(model, finding),
    }  # fmt: skip
    found, advice = _WORDS[finding.name]
    begin = f"joint {joint!r}: " if joint is not None else ""
    sentence, advised = (text.format(**numbers) for text in (found, advice))
    return Refuted(finding.name, joint, finding.p_value, finding.statistic, finding.share, begin + sentence, advised)


def _tilt(model: _core.Arm, finding: Finding) -> float:
    """The angle between the assumed and the estimated direction of gravity, in degrees."""
    gravity: Any = model.gravity_vector
    return math.nan if gravity is None else math.degrees(math.atan2(math.hypot(*finding.size), float(np.linalg.norm(gravity))))


#: For each assumption: what was found, and advice.
_WORDS = {
    "viscous": ("the residual follows the velocity, {size:.3g} {unit} per unit of velocity", 'add "viscous" to names'),
    "coulomb": ("the residual follows the sign of the velocity, {size:.3g} {unit}: Coulomb friction is missing", 'add "coulomb" to names'),
    "stribeck": (
        "the residual is large at low speeds, {size:.3g} {unit}: Stribeck friction is missing",
        'add "stribeck" to names, and choose stribeck_speed',
    ),
    "rotors": ("the residual follows the acceleration, {size:.3g} kg m^2 or kg: the rotor is missing", 'add "rotors" to names'),
    "offsets": ("the residual has the mean {size:.3g} {unit}: an offset of the torque is missing", 'add "offsets" to names'),
    "torque_constant": (
        "the recorded torque is {ratio:.3g} times that of the model",
        "check the torque constant and the gear ratio, and divide the torque by this number",
    ),
    "saturation": (
        "about {missing:.0f} % of the recorded torque beyond {value:.3g} {unit} is missing",
        "check the torque limit, and cut these parts of the log or record the applied torque",
    ),
    "jump": (
        "the residual jumps by {size:.3g} {unit} at about {value:.3g} s",
        "look for a contact, a changed load or a changed sensor, and cut the log there",
    ),
    "payload": ("the parameters of the last body change at about {value:.3g} s", "fit both parts of the log: log.cut"),
    "elasticity": (
        "the residual follows a deflection by the torque, with a stiffness of about {stiffness:.3g} {per}",
        "use positions from the sides of the links, or a plant with elastic joints",
    ),
    "delay": ("the torques act {late:.3g} ms later than assumed", "pass delay={delay:.3g}"),
    "clock_drift": (
        "the clock of the torques drifts from that of the positions by {drift:.3g} ms per second",
        "record both with one clock, or correct the times",
    ),
    "gravity": ("gravity is tilted by about {tilt:.2g} degrees", "check how the robot is mounted, and use arm.with_gravity"),
    "whiteness": (
        "the residual is correlated over more than the memory of the filter",
        "look at fit.plot(): the model lacks a part that no other test has named",
    ),
    "power": (
        "the power of the residual is not balanced in parts of the log",
        "look at fit.plot() for a part that differs from the others",
    ),
}
