"""Contacts and events that begin and end within one step of an adaptive method are found."""

import numpy as np
import pytest

import armlet as al

ADAPTIVE = ["dopri5", "dop853", "radau5", "rodas4"]
BOX = al.Arm.from_chain([{"type": "P", "axis": [1, 0, 0], "phi": [1.0] + [0.0] * 9}])
SPRING = al.PDGravity(BOX, [0.0], 1.0, 1e-12)  # with 1 kg, and a negligible damping: x = cos(t - phase)
PHASES = [0.4, 1.0, 1.7, 2.3, 2.9]


def swing(phase, method, plant=None, **options):
    start = {"v0": [np.sin(phase)], "t_end": 20.0, "method": method, "rtol": 1e-5, "atol": 1e-6}  # few steps per period
    return al.simulate(plant or al.RigidArm(BOX), SPRING, [np.cos(phase)], **start | options)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("phase", PHASES)
def test_both_crossings_of_a_short_dip_are_found(method, phase):
    level = 0.99
    rising, falling = al.Event.joint(0, level, direction=1), al.Event.joint(0, level, direction=-1)
    run = swing(phase, method, events=[lambda t, q, v: level - q[0], rising, falling])
    half, peaks = np.arccos(level), phase + 2 * np.pi * np.arange(4)
    enter, leave = [times[times < 20.0] for times in (peaks - half, peaks + half)]
    found = [run.events.t[run.events.which == i] for i in range(3)]
    # The errors of a run, some 1e-4 rad of x, move a crossing of slope sin(half) = 0.14 by up to 1e-2 s.
    for times, wanted in zip(found, [np.sort(np.concatenate([enter, leave])), enter, leave], strict=True):
        np.testing.assert_allclose(times, wanted, rtol=0.0, atol=2e-2)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("phase", PHASES)
def test_a_short_contact_with_a_stop_is_found(method, phase):
    stop = al.JointStops(1e3, 5.0, lower=-2.0, upper=0.99)  # N/m, N s/m, m
    run = swing(phase, method, al.RigidArm(BOX, stops=stop), t_end=phase + 2.0)
    # Each contact takes energy out, and rebounds. Without the contact, q would reach 1 m.
    tight = swing(phase, method, al.RigidArm(BOX, stops=stop), t_end=phase + 2.0, rtol=1e-9, atol=1e-11, max_step=0.01)
    assert run.q.max() < 0.9995 and abs(run.q[-1, 0] - tight.q[-1, 0]) < 1e-3  # the errors of a run, some 1e-4 m
