"""`read_log`: names and units of columns in the forms that robots, ROS and tables use, other sources, and the methods of a log."""

from __future__ import annotations

import pickle
import sys
from copy import deepcopy
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from matplotlib.figure import Figure

import armlet as al

ARM = models.TWO_LINKS
MOTION = al.Quintic([0.0, 0.0], [0.5, -0.3], 0.4)


def run() -> al.Run:
    return al.simulate(al.RigidArm(ARM), al.ComputedTorque(ARM, MOTION, 100.0, 20.0), [0.1, 0.0], t_end=0.5, dt=0.01)


def log_of(tmp_path: Path, text: str, **options: Any) -> al.Log:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    return al.read_log(path, **options)


# Header and separator of two samples of two joints: q 1 2, v 3 4, tau 5 6, in SI units after conversion.
FORMS = {
    "letters": ("t,q1,q2,v1,v2,tau1,tau2", {}),
    "letters from zero": ("t;q0;q1;dq0;dq1;tau_0;tau_1", {}),
    "ROS": ("__time,/js/b/position,/js/a/position,/js/b/velocity,/js/a/velocity,/js/b/effort,/js/a/effort", {}),
    "UR": ("timestamp actual_q_0 actual_q_1 actual_qd_0 actual_qd_1 target_x actual_moment_0 actual_moment_1", {}),
    "Franka": ("time\tstate.q[0]\tstate.q[1]\tstate.dq[0]\tstate.dq[1]\tstate.tau_J[0]\tstate.tau_J[1]", {}),
    "units in brackets": ("time [s],q1 [rad],q2 (rad),qdot1 [rad/s],qdot2 [rad/s],tau1 [N m],tau2 [Nm]", {}),
    "words": ("Time|JointPos1|JointPos2|JointVel1|JointVel2|JointTorque1|JointTorque2", {}),
    "names": ("t,shoulder_pos,elbow_pos,shoulder_vel,elbow_vel,shoulder_eff,elbow_eff", {"names": ["shoulder", "elbow"]}),
    "named columns": ("x,y,z,w,u,p,r", {"columns": {"t": "x", "q": ["y", "z"], "v": ["w", "u"], "tau": ["p", "r"]}}),
    "derivatives": ("t,q1,q2,qd1,qd2,tau1,tau2,qdd1,qdd2", {}),
    "comment": ("# recorded today\n# t q1 q2 dq1 dq2 tau1 tau2", {}),
    "names of an arm": ("t,joint1_pos,joint2_pos,joint1_vel,joint2_vel,joint1_effort,joint2_effort", {"arm": ARM}),
}


@pytest.mark.parametrize("form", FORMS)
def test_names_of_columns(form: str, tmp_path: Path) -> None:
    header, options = FORMS[form]
    separator = next((s for s in (",", ";", "\t", "|") if s in header), " ")
    columns = header.splitlines()[-1].lstrip("# ").split(separator)
    extra = {"target_x", "qdd1", "qdd2"}
    values = iter([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    first = [0.5 if name in extra else next(values) for name in columns]
    rows = "".join(separator.join(map(str, [t, *first[1:]])) + "\n" for t in (10.0, 10.25, 10.5))
    log = log_of(tmp_path, f"{header}\n{rows}", **options)
    np.testing.assert_array_equal(log.t, [0.0, 0.25, 0.5])
    assert log.start == 10.0 and log.v is not None and log.tau is not None
    for got, want in ((log.q, [1.0, 2.0]), (log.v, [3.0, 4.0]), (log.tau, [5.0, 6.0])):
        np.testing.assert_array_equal(got, [want] * 3)
    assert len(log.names) == 2 == log.n and log.units == ("rad", "rad")


def test_order_of_joints_is_that_of_the_arm(tmp_path: Path) -> None:
    log = log_of(tmp_path, "t,joint2_pos,gripper_pos,joint1_pos\n0,2,9,1\n1,2,9,1\n", arm=ARM)
    assert log.names == tuple(ARM.joint_names) and log.q.tolist() == [[1.0, 2.0]] * 2
    assert "not used: 'gripper_pos'" in str(log.report)


def test_units(tmp_path: Path) -> None:
    text = "time_ms,q1_deg,rail [mm],dq1 [rpm],rail_vel [cm/s],tau1_mNm,rail_force\n0,180,500,60,10,1000,7\n100,181,501,60,10,1000,7\n"
    arm = al.Arm.from_chain(
        [{"type": "R", "axis": [0, 0, 1], "phi": [1] + [0] * 9}, {"type": "P", "axis": [1, 0, 0], "phi": [1] + [0] * 9}]
    )
    columns = {"q": ["q1_deg", "rail [mm]"], "v": ["dq1 [rpm]", "rail_vel [cm/s]"], "tau": ["tau1_mNm", "rail_force"]}
    units = {"t": "ms", "q": ["deg", "mm"], "v": ["rpm", "cm/s"], "tau": ["mN m", "N"]}
    log = log_of(tmp_path, text, arm=arm, columns=columns, units=units)
    assert log.v is not None and log.tau is not None and log.units == ("rad", "m")
    np.testing.assert_allclose(log.t, [0.0, 0.1])
    np.testing.assert_allclose(log.q, [[np.pi, 0.5], [np.radians(181.0), 0.501]])
    np.testing.assert_allclose(log.v, [[2.0 * np.pi, 0.1]] * 2)
    np.testing.assert_allclose(log.tau, [[1.0, 7.0]] * 2)
    for name in ("q1_deg", "q1 [deg]", "q1[°]", "joint1_pos_deg", "pos_deg_1", "joint1.angle(degrees)"):
        np.testing.assert_allclose(log_of(tmp_path, f"t,{name}\n0,90\n1,91\n").q[0], np.pi / 2)
    dates = log_of(tmp_path, "time,q1\n1700000000123000000,0\n1700000000124000000,1\n")
    # Numbers of this size are multiples of 256.
    np.testing.assert_allclose(dates.t, [0.0, 0.001], atol=2.56e-7)
    assert "the times are dates in ns" in str(dates.report) and abs(dates.start - 1.7e9) < 1.0
    parts = log_of(tmp_path, "header.stamp.sec,header.stamp.nanosec,q1\n5,999000000,0\n6,1000000,1\n")
    np.testing.assert_allclose(parts.t, [0.0, 0.002])


def test_references_and_motor_positions(tmp_path: Path) -> None:
    header = "t,q1,q_d[1],cmd_vel1,tau_J_d1,target_acc_1,theta1,motor_torque_1"
    log = log_of(tmp_path, header + "\n0,1,2,3,4,5,6,7\n1,1,2,3,4,5,6,7\n")
    assert {name: values[0, 0] for name, values in log.references.items()} == {"q": 2.0, "v": 3.0, "tau": 4.0, "a": 5.0}
    assert log.theta is not None and log.tau is not None and (log.theta[0, 0], log.tau[0, 0], log.v) == (6.0, 7.0, None)


def test_text_without_header_and_with_decimal_commas(tmp_path: Path) -> None:
    log = log_of(tmp_path, "0 1 2\n1 3 4\n", columns={"t": 0, "q": [1, 2]})
    assert log.q.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    log = log_of(tmp_path, 'Versuch 3\n\n"Zeit";"q1";"q2"\n0,5;1,25;-2\n1,0;"1,5";2,5e1\n', columns={"t": "Zeit"})
    assert log.t.tolist() == [0.0, 0.5] and log.q.tolist() == [[1.25, -2.0], [1.5, 25.0]]
    log = log_of(tmp_path, "\ufeffmode,t,q1\r\nauto,0,1\r\nauto,1,2\r\n")
    assert log.q.tolist() == [[1.0], [2.0]] and "not used: 'mode'" in str(log.report)
    assert log_of(tmp_path, "q1,q2\n0,1\n1,2\n2,2\n", dt=0.1).t.round(9).tolist() == [0.0, 0.1, 0.2]


def test_npz_runs_and_tables(tmp_path: Path) -> None:
    made = run()
    from_run = al.read_log(made)
    assert from_run.names == tuple(ARM.joint_names) and set(from_run.references) == {"q", "v", "a"}
    np.testing.assert_array_equal(from_run.references["q"], MOTION(made.t)[0])
    made.save(tmp_path / "run.npz")
    np.savez(tmp_path / "arrays.npz", t=made.t, q=made.q, dq=made.v, effort=made.tau, names=["a", "b"], note="text")
    made.to_csv(tmp_path / "run.csv")
    for name, names in (("run.npz", from_run.names), ("arrays.npz", ("a", "b")), ("run.csv", from_run.names)):
        log = al.read_log(tmp_path / name)
        assert log.names == names
        for got, want in ((log.t, made.t), (log.q, made.q), (log.v, made.v), (log.tau, made.tau)):
            np.testing.assert_array_equal(got, want)
    elastic = al.ElasticArm(ARM, [400.0, 300.0], [0.1, 0.1])
    motors = al.simulate(elastic, al.MotorPD(ARM, [0.1, 0.2], 20.0, 5.0, [400.0, 300.0]), [0.0, 0.0], t_end=0.1, dt=1e-3)
    np.testing.assert_array_equal(al.read_log(motors).theta, motors.theta)
    commanded = al.simulate(
        al.VelocityArm(ARM), al.PriorityVelocity(ARM, [al.Task("link2", "xy", [0.6, 0.4], 5.0)]), [0.1, 0.9], t_end=0.1, dt=0.01
    )
    assert al.read_log(commanded).tau is None
    np.testing.assert_array_equal(al.read_log(commanded).references["v"], commanded.tau)


def test_parquet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """pyarrow is not among the test requirements, so a table of pandas takes the place of the file."""
    import pandas as pd

    (tmp_path / "log.parquet").write_bytes(b"PAR1")
    table = pd.DataFrame({"t": [0.0, 1.0], "q1": np.float32([1.0, 2.0]), "mode": ["a", "b"]})
    monkeypatch.setattr(pd, "read_parquet", lambda file: table)
    assert al.read_log(tmp_path / "log.parquet").q.tolist() == [[1.0], [2.0]]

    def damaged(file: Any) -> Any:
        raise ValueError("magic bytes")

    monkeypatch.setattr(pd, "read_parquet", damaged)
    with pytest.raises(al.FormatError, match="is damaged: expected a parquet file"):
        al.read_log(tmp_path / "log.parquet")


@pytest.mark.parametrize("module", ["rosbags", "pandas"])
def test_missing_libraries(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / {"rosbags": "log.mcap", "pandas": "log.parquet"}[module]
    path.write_bytes(b"x")
    with pytest.raises(ImportError, match=rf"^read_log: {module} is not installed: pip install"):
        al.read_log(path)


def test_csv_of_a_log_reads_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    t, (q, v, tau, theta, q_d, a_d) = np.cumsum(rng.uniform(0.1, 0.2, 50)), rng.normal(size=(6, 50, 2))
    log = al.Log(t, q, v=v, tau=tau, theta=theta, references={"q": q_d, "a": a_d}, names=["a, b", "rail"], units=["rad", "m"])
    log.to_csv(tmp_path / "log.csv")
    again = al.read_log(tmp_path / "log.csv", unwrap=False)
    assert (again.names, again.units) == (("a, b", "rail"), ("rad", "m"))
    np.testing.assert_allclose(again.t, t - t[0], rtol=0.0, atol=1e-15)
    for name in ("q", "v", "tau", "theta"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))
    for name in ("q", "a"):
        np.testing.assert_array_equal(again.references[name], log.references[name])


def test_pickles_figures_and_words() -> None:
    log = al.read_log(run())
    for copy in (pickle.loads(pickle.dumps(log)), deepcopy(log)):
        np.testing.assert_array_equal(copy.q, log.q)
        assert copy.report == log.report and repr(copy) == repr(log) == "<Log: 51 samples of 2 joints, 0.5 s: q, v, tau, q_d, v_d, a_d>"
    assert len(log) == 51
    axes = log.plot(Figure())
    assert [ax.get_title(loc="left") for ax in axes.flat[:3]] == ["Joint positions", "Joint velocities", "Joint torques"]
    shorter = log.cut(0.1, 0.2).resample(0.005).filter(20.0, order=1)
    assert shorter.report.steps == ("cut(0.1, 0.2)", "resample(0.005)", "filter(20 Hz, order 1)")
    assert (len(shorter), shorter.t[0], shorter.t[-1]) == (21, 0.1, pytest.approx(0.2))
