"""Scenario files: the objects that they make, errors with their paths, templates, the schema."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import scenario as scenarios
from armlet.scenario import TEMPLATES, Scenario, schema, template
from armlet.scenario.fields import Kind, OneOf
from armlet.scenario.tables import SCENARIO

GOOD: dict[str, Any] = {
    "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4]},
    "motion": {"kind": "Quintic", "q0": [0.0, 0.0], "q1": [0.5, 1.0], "duration": 0.5},
    "law": {"kind": "ComputedTorque", "kp": [100.0, 80.0], "kd": 20.0},
    "run": {"q0": [0.1, 0.0], "t_end": 0.6, "dt": 1e-3},
}


def changed(changes: dict[str, Any]) -> dict[str, Any]:
    """The tables GOOD with changes. A key is a table, or one entry as `table.key`. The value None removes it."""
    data = copy.deepcopy(GOOD)
    for path, value in changes.items():
        table, _, key = path.partition(".")
        place, name = (data.setdefault(table, {}), key) if key else (data, table)
        if value is None:
            place.pop(name)
        else:
            place[name] = value
    return data


TASK: dict[str, Any] = {"kind": "Task", "frame": "link2", "axes": "xy", "target": [0.5, 0.4], "gain": 5.0}
TASKS: dict[str, Any] = {"kind": "PriorityVelocity"}

POSES: dict[str, Any] = {
    "poses": [[0.6, 0.0], [0.7, 0.1], [0.6, 0.2], [0.6, 0.4]],
    "arcs": [1],
    "axes": "xy",
    "frame": "link2",
    "q0": [-0.5, 1.0],
}
TIMED: dict[str, Any] = {"kind": "TimedPath", "tau_max": [20.0, 8.0], "tip_speed": 0.4, "frame": "link2", "stops": [2], "path": POSES}


def timed(change: dict[str, Any], **path: Any) -> dict[str, Any]:
    """A motion along poses with changed keys. `path` changes keys of the table of poses."""
    return {"motion": TIMED | {"path": POSES | path} | change}


# Changes, and the message of the error without the scenario's name.
REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"law": None}, "$.law: is missing: expected a table with kind = one of Adaptive, "),
    ({"law": 3}, "$.law: expected a table with kind = one of Adaptive, "),
    ({"law.kind": "adaptive"}, "got 'adaptive' (did you mean Adaptive?)"),
    ({"law.kind": []}, "$.law.kind: expected one of Adaptive, "),
    ({"law.kind": {"name": "Adaptive"}}, "$.law.kind: expected one of Adaptive, "),
    ({"law.kind": None}, "$.law.kind: is missing: expected one of Adaptive, ComputedTorque, "),
    ({"law.kd": -1.0}, "$.law.kd: expected > 0, got -1.0"),
    ({"law.kd": 0}, "$.law.kd: expected > 0, got 0"),
    ({"law.kd": [20.0, -2.0]}, "$.law.kd[1]: expected > 0, got -2.0"),
    ({"law.kd": [[20.0, 0.0], [0.0, -2.0]]}, "$.law.kd: is not positive definite: expected "),
    ({"law.kd": [20.0, [2.0]]}, "$.law.kd[1]: expected a number like [0], got [2.0]"),
    ({"law.kd": [20.0, "2"]}, "$.law.kd[1]: expected a number, got '2'"),
    ({"law.kd": [20.0, float("nan")]}, "$.law.kd[1]: expected a finite number, got nan"),
    ({"law.kd": 10**400}, "$.law.kd: expected a finite number, got inf"),
    ({"law.kd": True}, "$.law.kd: expected a number or a list of numbers or of rows, got true"),
    ({"law.kd": []}, "$.law.kd: expected a number or a list of numbers or of rows, got an empty list"),
    ({"law.kd": [1.0, 2.0, 3.0]}, "$.law.kd: has the wrong shape: expected a scalar, (2,) or (2, 2), got (3,)"),
    ({"law.kd": None}, "$.law.kd: is missing: expected a number or a list of numbers or of rows"),
    ({"law.gain": 1.0}, "$.law: unknown key 'gain': expected some of kp, kd"),
    ({"runn": {}}, "$: unknown key 'runn' (did you mean run?): expected some of title, arm, "),
    ({"motion": None}, "$.motion: is missing: the law ComputedTorque follows one: expected a table with kind = one of Hold, "),
    ({"law": {"kind": "PDGravity", "target": [0.0, 0.0], "kp": 1.0, "kd": 1.0}}, "$.motion: is not used by the law PDGravity: expected "),
    ({"motion.q1": [1.0, 2.0, 3.0]}, "$.motion.q1: "),
    ({"run.method": "rk5"}, "$.run.method: expected one of euler, semi_implicit, rk4, ros2, dopri5, dop853, radau5, rodas4, stiff"),
    ({"run.dt": None}, "$.run.dt: is missing: expected a step in seconds for a fixed-step method"),
    ({"run.q0": [0.0]}, "$.run.q0: has the wrong shape: expected (2,), got (1,)"),
    ({"run.t_end": -1.0}, "$.run.t_end: expected >= 0, got -1.0"),
    ({"run.record_every": 0}, "$.run.record_every: expected an integer >= 1, got 0"),
    ({"run.record_every": 2.5}, "$.run.record_every: expected an integer >= 1, got 2.5"),
    ({"run.t_eval": {"step": 1e-308}}, "$.run.t_eval: is too fine: expected at most 10,000,000 records, got a step of 1e-308 s"),
    ({"run.monitors": "yes"}, "$.run.monitors: expected true or false, got 'yes'"),
    ({"run.sample_time": {"perod": 1e-3}}, "$.run.sample_time: unknown key 'perod' (did you mean period?): expected some of period, "),
    ({"run.sample_time": {"period": 1e-3, "noise": {"x": 1.0}}}, "$.run.sample_time.noise: unknown key 'x': expected some of q, v, "),
    ({"run.sample_time": {"period": 1e-3, "jitter": 2e-3}}, "$.run.sample_time.jitter: "),
    ({"run.force": [{"t": 1.0}]}, "$.run.force[0].force: is missing: expected a list of numbers"),
    ({"run.force_frame": "hand"}, "expected"),
    ({"arm.kind": "planar"}, "$.arm.kind: expected one of planar_pr, planar_arm, pendulum, urdf, example, chain, got 'planar'"),
    ({"arm.lengths": [0.5, 0.0]}, "$.arm.lengths[1]: expected > 0, got 0.0"),
    ({"arm": {"kind": "urdf"}}, "$.arm.path: expected either path or xml, got neither"),
    ({"arm": {"kind": "urdf", "path": "none.urdf"}}, "$.arm.path: cannot be read: expected a URDF file or its text, got "),
    ({"arm": {"kind": "urdf", "xml": "<robot><link/></robot>"}}, "$.arm: "),
    ({"arm": {"kind": "example", "name": "ur5"}}, "$.arm.name: is unknown: expected one of planar_2r, "),
    ({"arm": {"kind": "chain", "joints": [{"type": "X"}]}}, "$.arm.joints[0].type: expected one of R, P, F, "),
    ({"arm.payload": {"frame": "tip", "mass": 1.0}}, "$.arm.payload.frame: "),
    ({"plant": {"kind": "ElasticArm", "stiffness": [1.0, 2.0], "motor_inertia": [1.0, 2.0]}}, "$.law: is made for another plant: "),
    ({"plant": {"kind": "RigidArm", "friction": 1}}, "$.plant.friction: expected true or false, got 1"),
    ({"motion": None, "law": TASKS | {"tasks": []}}, "$.law.tasks: expected a list of at least 1 tables, got []"),
    ({"motion": None, "law": TASKS | {"tasks": [TASK | {"frame": "hand"}]}}, "$.law.tasks[0].frame"),
    (
        {"motion": None, "law": TASKS | {"tasks": [TASK, TASK | {"target": [1.0]}]}},
        "$.law.tasks[1].target: has the wrong shape: expected (2,), got (1,)",
    ),
    ({"motion": None, "law": TASKS | {"tasks": [TASK, TASK | {"axes": "xq"}]}}, "$.law.tasks[1].axes"),
    ({"motion": None, "law": TASKS | {"tasks": [TASK | {"kind": "task"}]}}, "$.law.tasks[0].kind: expected one of Task, PostureTask, "),
    (timed({}, pose=[[0.6]]), "$.motion.path: unknown key 'pose' (did you mean poses?): expected some of poses, q0, frame, "),
    (timed({}, kind="circle"), "$.motion.path.kind: expected one of lines, spline, got 'circle'"),
    (timed({}, q0=[0.0]), "$.motion.path.q0: has the wrong shape: expected (2,), got (1,)"),
    (timed({}, poses=[[0.6, 0.0], [1.6, 0.0]], arcs=[0]), "$.motion.path.arcs: is out of range: expected "),
    (timed({}, poses=[[0.6, 0.0], [0.7, 0.0], [1.6, 0.0]]), "$.motion.path.arcs: has no circle at pose 1: expected "),
    (
        timed({}, poses=[[0.6, 0.0], [0.7, 0.1], [1.6, 0.2]]),
        "$.motion.path.poses: is not feasible: the arm can't follow the poses from s = ",
    ),
    (timed({"stops": [4]}), "$.motion.stops[0]: is out of range: expected indices of poses below 4, got 4"),
    (timed({"tip_sped": 1.0}), "$.motion: unknown key 'tip_sped' (did you mean tip_speed?)"),
    ({"sweep": {"vary": {}}}, "$.sweep.vary: expected a table with at least one entry, got an empty table"),
    ({"sweep": {"vary": {"law.kd": 1.0}}}, '$.sweep.vary."law.kd": expected a list of values, or a table '),
]


@pytest.mark.parametrize(("changes", "message"), REFUSED, ids=[message[:50] for _, message in REFUSED])
def test_refusals(changes: dict[str, Any], message: str) -> None:
    """Each scenario is refused before a run, with one line. `check` refuses the scenarios that `run` refuses."""
    for act in ("run", "check"):
        with pytest.raises(al.InputError) as caught:
            getattr(Scenario.from_dict(changed(changes)), act)()
        text = str(caught.value)
        assert text.startswith("scenario: $") and message in text and "\n" not in text, text


def test_several_problems_are_counted() -> None:
    bad = changed({"law.kd": -1.0, "run.dt": "x"})
    assert len(list(Scenario.problems(bad))) == 2
    with pytest.raises(al.InputError, match=r"and 1 more"):
        Scenario(bad)


def test_the_same_as_in_python() -> None:
    built = Scenario.from_dict(GOOD).build()
    arm = models.TWO_LINKS
    law = al.ComputedTorque(arm, al.Quintic([0.0, 0.0], [0.5, 1.0], 0.5), [100.0, 80.0], 20.0)
    run = al.simulate(al.RigidArm(arm), law, [0.1, 0.0], t_end=0.6, dt=1e-3)
    for other in (Scenario.from_dict(GOOD).run(), al.simulate(built.plant, built.law, **built.arguments)):
        np.testing.assert_array_equal(run.q, other.q)
        np.testing.assert_array_equal(run.tau, other.tau)


def test_a_motion_along_poses() -> None:
    """The motion equals that of `cartesian_path` and `time_path` in Python. The arm stops only at the pose in `stops`."""
    data = changed({"motion": TIMED, "run.q0": [-0.5, 1.0]})
    built = Scenario.from_dict(data).build()
    arm = models.TWO_LINKS
    path = al.cartesian_path(arm, **POSES)
    motion = al.time_path(arm, path, tau_max=[20.0, 8.0], tip_speed=0.4, frame="link2", stops=[path.corners[2]])
    law = al.ComputedTorque(arm, motion, [100.0, 80.0], 20.0)
    run = al.simulate(al.RigidArm(arm), law, [-0.5, 1.0], t_end=0.6, dt=1e-3)
    np.testing.assert_array_equal(run.q, al.simulate(built.plant, built.law, **built.arguments).q)
    speeds = motion.s_dot[np.searchsorted(motion.s, path.s[path.corners])]
    assert speeds[2] == 0.0 and speeds[1] > 0.1


def test_run_options() -> None:
    options = {"q0": [0.1, 0.0], "v0": [0.0, 0.2], "t_end": 0.6, "method": "dop853", "t_eval": {"step": 0.1}, "tau_max": 20.0}
    options |= {"force": [{"t": 0.2, "force": [1.0, 0.0, 0.0]}, {"t": 0.4, "force": [0.0, 0.0, 0.0]}], "force_frame": "link2"}
    run = Scenario.from_dict(changed({"run": options})).run()
    np.testing.assert_allclose(run.t, np.linspace(0.0, 0.6, 7), rtol=0.0, atol=1e-15)  # rounding of the steps
    assert np.abs(run.tau).max() <= 20.0 and run.v[0, 1] == 0.2
    sampled = {"q0": [0.1, 0.0], "t_end": 0.6, "dt": 1e-3, "sample_time": {"period": 0.01, "noise": {"v": 0.1}, "seed": 4}}
    one, same = (Scenario.from_dict(changed({"run": sampled})).run() for _ in range(2))
    np.testing.assert_array_equal(one.q, same.q)
    other = Scenario.from_dict(changed({"run": sampled})).replace({"run.sample_time.seed": 5}).run()
    assert not np.array_equal(one.q, other.q)


def test_stops_and_torque_sensors_are_those_of_python() -> None:
    arm, given = models.TWO_LINKS, {"stiffness": 1e4, "damping": 10.0, "upper": [0.25, 3.0]}
    sensor = {"noise": 0.1, "bias": [0.5, -0.3], "bandwidth": 2000.0}
    gains = {"kp": 200.0, "kd": 20.0, "kt": 1.0, "ks": 0.02}
    scenario = al.Scenario.from_dict(
        {
            "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4]},
            "plant": {"kind": "ElasticArm", "stiffness": [800.0, 500.0], "motor_inertia": [0.4, 0.25], "stops": given},
            "law": {"kind": "StateFeedback", "target": [0.3, 1.0]} | gains,
            "run": {"q0": [0.0, 0.5], "t_end": 0.1, "dt": 1e-4, "sample_time": {"period": 1e-3, "torque_sensor": sensor, "seed": 1}},
        }
    )
    plant = al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25], stops=al.JointStops(1e4, 10.0, upper=[0.25, 3.0]))
    law = al.StateFeedback(arm, [0.3, 1.0], joint_stiffness=[800.0, 500.0], **gains)
    clock = al.Sampling(1e-3, torque_sensor=al.TorqueSensor(noise=0.1, bias=[0.5, -0.3], bandwidth=2000.0), seed=1)
    expected = al.simulate(plant, law, [0.0, 0.5], t_end=0.1, dt=1e-4, sample_time=clock)
    np.testing.assert_array_equal(scenario.run().q, expected.q)


def test_the_law_may_believe_in_another_arm() -> None:
    other = Scenario.from_dict(changed({"model": {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [1.0, 2.0]}}))
    assert not np.array_equal(other.build().law.arm.parameters, other.build().plant.arm.parameters)
    assert not np.array_equal(other.run().q, Scenario.from_dict(GOOD).run().q)


def test_files(tmp_path: Path) -> None:
    """Paths are relative to the file. `standalone` removes the dependence on files. A scenario can be pickled."""
    (tmp_path / "robot.urdf").write_text(al.example_urdf("planar_2r"))
    text = '[arm]\nkind = "urdf"\npath = "robot.urdf"\n[law]\nkind = "PDGravity"\ntarget = [0.2, 0.3]\nkp = 50.0\nkd = 10.0\n'
    file = tmp_path / "a.toml"
    file.write_text(text + "[run]\nq0 = [0.0, 0.0]\nt_end = 0.1\ndt = 1e-3\n")
    scenario = Scenario.load(file)
    run, alone = scenario.run(), scenario.standalone()
    (tmp_path / "robot.urdf").unlink()
    np.testing.assert_array_equal(run.q, pickle.loads(pickle.dumps(alone)).run().q)
    with pytest.raises(al.InputError, match=r"a\.toml: \$\.arm\.path: cannot be read"):
        scenario.run()
    file.write_text("[arm\n")
    with pytest.raises(al.InputError, match=r"a\.toml: is not TOML: .*line 1"):
        Scenario.load(file)
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(al.InputError, match="is not TOML"):
        Scenario.load(file)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("law.kp[2]", "holds 2 entries, got 2"),
        ("law.kd[0]", "holds 20.0, got 0"),
        ("lwa.kd", "'lwa.kd' leads nowhere: expected a part of the scenario, which holds arm, motion, law, run, got 'lwa'"),
        ("law..kd", "is not a path"),
        ("", "is not a path"),
        ("law.gain", "unknown key 'gain'"),
    ],
)
def test_replace_refuses(path: str, message: str) -> None:
    with pytest.raises(al.InputError) as caught:
        Scenario.from_dict(GOOD).replace({path: 1.0})
    assert message in str(caught.value)


def test_replace_leaves_the_first_as_it_was() -> None:
    first = Scenario.from_dict(GOOD)
    second = first.replace({"law.kp[1]": 90.0, "run.q0": np.array([0.2, 0.3]), "run.tau_max": 50})
    assert second.data["law"]["kp"] == [100.0, 90.0] and second.data["run"]["q0"] == [0.2, 0.3]
    assert first.data["law"]["kp"] == [100.0, 80.0] and "tau_max" not in first.data["run"]


def test_replace_changes_one_table() -> None:
    """If two tables are one dict, a change affects only the named table."""
    arm = {"kind": "planar_arm", "lengths": [0.5, 0.4]}
    scenario = Scenario(GOOD | {"arm": arm, "model": arm}).replace({"arm.masses": [1.0, 2.0]})
    assert (
        "masses" not in scenario.data["model"] and scenario.standalone().replace({"model.lengths[0]": 0.6}).data["arm"]["lengths"][0] == 0.5
    )


@pytest.mark.parametrize("name", TEMPLATES)
def test_templates_run(name: str, tmp_path: Path) -> None:
    file = tmp_path / "t.toml"
    file.write_text(template(name))
    run = Scenario.load(file).run()
    assert run.status is al.Status.SUCCESS and "#" in template(name)
    # The template has a loop that works: errors are small at the end, and no monitor is violated.
    assert np.nanmax(run.metrics()["error_final"], initial=0.0) < 0.02 and run.metrics()["monitor_violations"] == 0


def test_unknown_template() -> None:
    with pytest.raises(al.InputError, match="adaptive, elastic, mintime, priority"):
        template("nothing")


def holds(value: Any, form: dict[str, Any]) -> bool:
    """Whether a value satisfies a JSON schema. Only the parts that `schema()` uses are implemented."""
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float), "integer": int}
    if "enum" in form or "const" in form:
        return bool(value in form.get("enum", [form.get("const")]))
    if "type" in form and (not isinstance(value, kinds[form["type"]]) or (isinstance(value, bool) and form["type"] != "boolean")):
        return False
    if isinstance(value, dict | list) and len(value) < form.get("minItems", form.get("minProperties", 0)):
        return False
    if isinstance(value, dict) and "type" in form and "oneOf" not in form:
        known, other = form.get("properties", {}), form.get("additionalProperties", True)
        inside = all(
            holds(item, known[key]) if key in known else other is True or (other and holds(item, other)) for key, item in value.items()
        )
        return inside and set(form.get("required", ())) <= set(value)
    if isinstance(value, list) and not all(holds(item, form.get("items", {})) for item in value):
        return False
    if isinstance(value, int | float) and (value < form.get("minimum", -np.inf) or value <= form.get("exclusiveMinimum", -np.inf)):
        return False
    if "oneOf" in form:
        return sum(holds(value, each) for each in form["oneOf"]) == 1
    return "anyOf" not in form or any(holds(value, each) for each in form["anyOf"])


def test_the_schema_agrees_with_the_check() -> None:
    import tomllib

    form = schema()
    for name in TEMPLATES:
        assert holds(tomllib.loads(template(name)), form)
    assert holds(GOOD, form)
    # JSON has no NaN and no infinity, so these cases are left out. The schema refuses all other data that `SCENARIO.check` refuses.
    refused = [changed(changes) for changes, message in REFUSED if "expected a finite number" not in message]
    refused = [data for data in refused if list(SCENARIO.check(data, "$"))]
    assert len(refused) >= 20
    assert [data for data in refused if holds(data, form)] == []


def test_every_class_is_in_the_tables() -> None:
    """Every public law, plant and motion is available in scenarios."""
    for table, base in (("law", al.Law), ("plant", al.Plant), ("motion", al.Motion)):
        public = {name for name in al.__all__ if isinstance(getattr(al, name), type) and issubclass(getattr(al, name), base)}
        what = SCENARIO.keys[table]
        assert isinstance(what, OneOf) and public - {base.__name__} == set(what.kinds)
        assert all(isinstance(kind, Kind) and set(kind.required) <= set(kind.keys) for kind in what.kinds.values())


def test_the_package_gives_its_names() -> None:
    assert all(hasattr(scenarios, name) for name in scenarios.__all__)
