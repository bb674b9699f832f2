"""The torques of a known law along a log without torques: `tau_k = law(t_k, q_k, v_k)`, which the recorded measurements determine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import _core
from ..errors import InputError
from ..logs.log import Log
from ..run.sampling import Sampling, period_of
from .samples import NAME

__all__ = ["with_torques_of"]

#: Largest relative difference of the log's period from that of the law.
CLOSE = 0.01
#: Effects of a `Sampling` that change the torque between the law and the plant, or its measurements.
EFFECTS = ("jitter", "sensor_delay", "torque_sensor")


def with_torques_of(law: _core.Law | None, arguments: Mapping[str, Any], log: Log) -> Log:
    """The log with the torques that the law computes from the recorded positions and velocities.

    Args:
        law: the law; None if it is not known.
        arguments: those of `simulate`, of which `sample_time` and `tau_max` change the torque.
        log: the log, whose times are those of the law.

    Raises:
        InputError: the log does not determine the torques.
    """
    head = f"{NAME}: log has no torques"
    if law is None:
        raise InputError(f"{head}: expected torques, or a model with a law that determines them: a (plant, law) or a Scenario")
    if log.v is None:
        raise InputError(f"{head} and no velocities: expected both positions and velocities, from which the law computes the torques")
    if law._state_count:
        raise InputError(f"{head}: expected a law without a state, got {type(law).__name__}; record the torques")
    loop = arguments.get("sample_time")
    period = period_of(loop)
    if isinstance(loop, Sampling) and (any(getattr(loop, name) for name in EFFECTS) or np.isfinite(loop.rate_limit)):
        raise InputError(f"{head}: expected a sample_time without {', '.join(EFFECTS)} and rate_limit; record the torques")
    if period and abs(log.report.period - period) > CLOSE * period:
        raise InputError(f"{head}: expected one sample for each sample of the law, {period:g} s apart, got {log.report.period:g} s")
    try:
        tau = np.array([law(float(t), q, v) for t, q, v in zip(log.t, log.q, log.v, strict=True)])
    except InputError as error:
        raise InputError(f"{head}, and the law cannot compute them: {error}") from error
    most = arguments.get("tau_max")
    if most is not None:
        tau = np.clip(tau, -np.asarray(most), np.asarray(most))
    return Log(
        log.t, log.q, v=log.v, tau=tau, theta=log.theta, references=log.references, names=log.names, units=log.units, start=log.start
    )
