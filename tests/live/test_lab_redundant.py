"""Laboratory systems with redundant arms: the null space of an impedance law, and the momentum observer."""

from __future__ import annotations

import numpy as np

import armlet as al
from armlet.live.model import FRAME, WINDOW, Lab
from armlet.live.systems import Observer, Redundant
from armlet.live.systems.observer import START


def run(lab: Lab, seconds: float) -> None:
    for _ in range(round(seconds / FRAME)):
        lab.advance()


def test_the_null_space_moves_and_the_tip_stays() -> None:
    """A posture in the null space moves the arm more than 0.3 rad.

    The tip moves only through the inertial coupling, and not at all when the law compensates this coupling.
    """
    moved = {}
    for coupling in ("left", "compensated"):
        lab = Lab([Redundant()])
        lab.set("coupling", coupling)
        lab.set("posture", 1.2)
        run(lab, WINDOW)
        moved[coupling] = float(np.abs(lab.panels()[0][1:]).max())
        assert np.abs(lab.q - lab.system.q0).max() > 0.3  # rad
        kinetic, loss = lab.panels()[2][1:]
        assert kinetic.max() > 1e-3 and kinetic[-1] < 1e-6 and not loss.any()  # J
    assert moved["compensated"] < 1e-6 < 1e-5 < moved["left"]  # m
    # The static projector moves the tip more than the dynamic one. Without a null-space law the arm does not move.
    for projection, low, high in (("static", 2.0 * moved["left"], 1.0), ("none", 0.0, 1e-9)):
        lab = Lab([Redundant()])
        lab.set("projection", projection)
        lab.set("posture", 1.2)
        run(lab, 2.0)
        assert low <= np.abs(lab.panels()[0][1:]).max() < high


def test_a_hand_stretches_the_arm_to_its_clamp() -> None:
    """A target beyond the workspace makes the arm singular: the plot shows the loss, and the loop continues."""
    lab = Lab([Redundant()])
    lab.set("coupling", "compensated")
    lab.drag("x_d", lab.targets["x_d"] + np.array([1.0, 0.4, 0.6]))
    run(lab, 6.0)
    assert lab.status is al.Status.SUCCESS and 0.0 < np.max(lab.panels()[2][2]) <= 1.0


def test_the_observer_feels_a_push() -> None:
    lab = Lab([Observer()])
    run(lab, 1.0)
    assert not np.any(lab.panels()[2][1])
    lab.set("push", 12.0)
    run(lab, 2.0)
    first, largest, touched = lab.panels()
    residuals, truth = np.array([curve[-1] for curve in first[1:]]).reshape(2, 3)
    # The arm is almost at rest, so the residual r is close to J'F.
    np.testing.assert_allclose(residuals, truth, atol=1e-3)
    assert np.abs(truth).max() > 1.0 and largest[1][-1] > largest[2][-1] == 0.5
    # The line of the force passes through the last axis, so joint 6 is the outermost joint with a torque.
    assert touched[1][-1] == 6.0
    # A new threshold does not reset the observer. A pull at the third link loads only joints 1 to 3.
    lab.set("threshold", 5.0)
    lab.set("push", 0.0)
    run(lab, 1.0)
    assert lab.panels()[2][1][-1] == 0.0
    lab.set("threshold", 0.2)
    frame = lab.system.arm.frame_names[3]
    pose = np.asarray(lab.system.arm.pose(lab.q, frame))
    point = pose[:3, 3] + 0.1
    lab.grip(frame, point)
    lab.pull(point + np.array([0.0, 0.4, 0.0]), 60.0)
    run(lab, 2.0)
    touched_link = lab.panels()[2][1][-1]
    assert 1.0 <= touched_link <= 3.0


def test_the_observer_reports_a_payload_as_a_push() -> None:
    lab = Lab([Observer()])
    lab.set("payload", 1.0)
    run(lab, 4.0)
    r = [curve[-1] for curve in lab.panels()[0][1:4]]
    arm = lab.system.arm
    unknown = arm.gravity(lab.q) - arm.with_payload("tcp", 1.0).gravity(lab.q)
    np.testing.assert_allclose(r, unknown[[0, 1, 3]], atol=1e-2)
    assert np.abs(r).max() > 2.0


def test_the_arm_reacts_to_a_push() -> None:
    """The laboratory reacts to a contact as `al.Guarded` does.

    A message reports the reaction. Moving a slider keeps it, and a reset ends it.
    """
    moved = {}
    for reaction in ("stop", "float", "retract"):
        lab = Lab([Observer()])
        lab.set("reaction", reaction)
        run(lab, 0.5)
        assert lab.message == "" and not np.any(lab.panels()[2][2])
        lab.set("push", 12.0)
        run(lab, 0.5)
        told = lab.message
        assert told.startswith("contact at t = 0.5") and reaction in told and lab.panels()[2][2][-1] == 1.0
        lab.set("threshold", 4.0)  # a new loop continues the reaction that started before
        lab.set("push", 0.0)
        run(lab, 2.0)
        assert lab.message == told and lab.panels()[2][2][-1] == 1.0
        moved[reaction] = float(lab.system.arm.position(lab.q, "tcp")[1] - lab.system.arm.position(START, "tcp")[1])
        lab.reset()
        lab.set("push", 0.0)
        run(lab, 0.5)
        assert lab.message == "" and lab.panels()[2][2][-1] == 0.0 and np.abs(lab.q - START).max() < 1e-9
    # "retract" moves the arm along the push, "float" lets the push move the arm, and "stop" holds the arm at the place of contact.
    assert abs(moved["stop"]) < 1e-3 < 1e-2 < min(moved["retract"], moved["float"])


def test_another_reaction_starts_from_no_contact() -> None:
    lab = Lab([Observer()])
    lab.set("reaction", "float")
    lab.set("push", 12.0)
    run(lab, 0.3)
    assert lab.message.startswith("contact")
    lab.set("push", 0.0)
    run(lab, 0.5)
    lab.set("reaction", "stop")
    run(lab, 0.5)
    assert lab.message == "" and lab.panels()[2][2][-1] == 0.0
