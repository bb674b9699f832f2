"""Logs against the reference: recursions over samples in place of Fourier coefficients, and numbers in place of arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal
from trees import close

import armlet as al
from armlet.reference import logs as ref

Array = NDArray[np.float64]


def recorded(K: int, n: int, seed: int) -> tuple[Array, Array, Array]:
    """Times with equal intervals, smooth positions with noise, and torques with jumps."""
    rng = np.random.default_rng(seed)
    t = 0.02 * np.arange(K)
    q = np.sin(np.outer(t, rng.uniform(1.0, 3.0, n)) + rng.uniform(-3.0, 3.0, n)) + t[:, None] + 0.01 * rng.normal(size=(K, n))
    return t, q, np.sign(np.diff(q, axis=0, prepend=0.0)) + rng.normal(size=(K, n))


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize(("cutoff", "K"), [(2.0, 60), (9.0, 60), (24.0, 33), (0.3, 150)])
def test_filter(cutoff: float, K: int, order: int) -> None:
    t, q, tau = recorded(K, 3, K)
    log = al.Log(t, q, tau=tau, references={"q": 2.0 * q}).filter(cutoff, order=order)
    close(log.q, ref.low_pass(q, 0.02, cutoff, order), tolerance=1e-10)
    assert log.tau is not None
    close(log.tau, ref.low_pass(tau, 0.02, cutoff, order), tolerance=1e-10)
    close(log.references["q"], 2.0 * log.q)


def test_filter_is_that_of_scipy() -> None:
    """Between the ends, the filter equals `sosfiltfilt`, which continues the signal in another form."""
    t, q, _ = recorded(2000, 2, 1)
    sections = signal.butter(2, 3.0, fs=50.0, output="sos")
    want = signal.sosfiltfilt(sections, q, axis=0)
    np.testing.assert_allclose(al.Log(t, q).filter(3.0).q[300:-300], want[300:-300], atol=1e-9)


def test_filter_has_no_phase_and_half_the_gain_at_its_cutoff() -> None:
    t = 0.001 * np.arange(8001)
    for frequency, gain in ((0.5, 1.0), (5.0, 0.5), (100.0, 0.0)):
        wave = np.sin(2.0 * np.pi * frequency * t)[:, None]
        middle = al.Log(t, wave).filter(5.0).q[2000:6000, 0]
        np.testing.assert_allclose(middle, gain * wave[2000:6000, 0], atol=2e-4)


@pytest.mark.parametrize("dt", [0.005, 0.02, 0.033])
def test_resample(dt: float) -> None:
    t, q, tau = recorded(40, 2, 3)
    t = t + np.random.default_rng(0).uniform(-0.008, 0.008, 40)
    log = al.Log(t, q, tau=tau).resample(dt)
    close(log.t, t[0] + dt * np.arange(len(log.t)))
    assert log.t[-1] <= t[-1] < log.t[-1] + dt
    close(log.q, ref.resampled(log.t, t, q), tolerance=1e-11)
    assert log.tau is not None
    close(log.tau, ref.resampled(log.t, t, tau), tolerance=1e-11)


def test_wrapped_angles_and_missing_samples(tmp_path: Path) -> None:
    """`read_log(unwrap)` against the shortest turn, and the count of dropped samples against a set of integers."""
    rng = np.random.default_rng(5)
    t = 0.01 * np.arange(2000)
    q = 4.0 * np.sin(np.outer(t, [1.0, 1.7])) + [0.0, 8.0]
    kept = rng.uniform(size=len(t)) > 0.01
    kept[[0, -1]] = True
    folded = (q + np.pi) % (2.0 * np.pi) - np.pi
    path = tmp_path / "log.csv"
    header = ",".join(["t", "q1", "q2"])
    np.savetxt(path, np.column_stack([t, folded])[kept], delimiter=",", header=header, comments="", fmt="%.17g")
    log = al.read_log(path)
    for joint in range(2):
        close(log.q[:, joint], ref.continued(folded[kept, joint]), tolerance=1e-11)
    assert log.report.dropped == ref.missing_samples(t[kept], 0.01) == np.count_nonzero(~kept) > 10
    assert min(log.report.wraps) > 5
    np.testing.assert_array_equal(al.read_log(path, unwrap=False).q, folded[kept])
