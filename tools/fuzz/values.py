"""Python source of arguments: plausible ones, selected by the parameter's name and type, and odd ones."""

from __future__ import annotations

from collections.abc import Callable

from objects import Objects
from signatures import Parameter
from tables import METHODS, SCENARIO


class Values(Objects):
    """Source texts of the arguments of one call."""

    def argument(self, target: str, parameter: Parameter) -> str:
        """A plausible value of a parameter. Its name is considered first, then its type."""
        made = self.by_name(target, parameter.name) or self.by_type(parameter.annotation)
        return made if made is not None else self.odd()

    def by_name(self, target: str, name: str) -> str | None:
        n, chance = self.n, self.chance
        joints = {"q", "v", "a", "tau", "v_r", "a_r", "q0", "q1", "v0", "theta0", "theta_dot0", "theta", "theta_dot", "target", "phase"}
        joints.add("q_d")
        if target in {"integrate", "scipy_method"}:
            return self.of_integrate(name)
        if target.endswith("_time") and name in {"theta0", "thetaf"}:
            return self.number() if chance.random() < 0.8 else self.vector(2)
        if target == "Sensitivity":
            return {"name": "'q0'", "shape": f"({n},)"}.get(name, f"np.zeros((3, {n}, {n}))")
        if name == "target" and "Task" in target:
            return self.vector({"PostureTask": n, "AxisTask": 3}.get(target, 2))
        if name == "target" and target in {"ElasticTracking"}:
            return self.motion()
        if name == "target" and target in {"CartesianImpedance", "ElasticImpedance"}:
            return self.vector(2)
        if name == "q0" and target == "simulate_batch":
            return self.matrix(self.rows, n)
        if name == "law" and target == "select_samples":
            return f"al.Adaptive({self.arm}, al.Hold({[0.1] * n}), 10.0, 5.0, 0.1)"
        if name in {"q", "v", "a", "tau"} and target.endswith(("identify", "Table", "select_samples")):
            return f"np.random.default_rng({self.count()}).normal(size=({self.count(60)}, {n}))"
        if name in joints:
            return self.vector(n, batch=target.startswith("Arm."))
        if name in {"stiffness", "damping"} and target in {"CartesianImpedance", "ElasticImpedance", "ElasticTracking"}:
            return self.gain(2)
        plain: dict[str, Callable[[], str]] = {
            "kp": self.gain,
            "kd": self.gain,
            "kt": self.gain,
            "ks": self.gain,
            **dict.fromkeys(["gamma", "gain", "friction_speed", "leakage", "dead_zone", "threshold", "sigmas"], self.positive),
            **dict.fromkeys(["composite", "composite_rate", "concurrent_weight", "window", "speed", "duration"], self.positive),
            "concurrent": lambda: f"al.Samples(np.ones((2, {n}, {10 * n})), np.ones((2, {n})), np.arange(2), 1.0, 1)",
            "observer": lambda: f"al.MomentumObserver({self.arm}, 50.0, threshold=1.0)",
            "W": lambda: f"np.ones((2, {n}, {10 * n}))",
            "time": self.positive,
            "reaction": lambda: self.text("stop", "float", "retract"),
            "residual": lambda: self.vector(n),
            "held": lambda: self.text("True", "False").strip("'"),
            "residuals": lambda: self.matrix(4, n),
            "leakage_form": lambda: self.text("sigma", "e"),
            "stiffness": self.gain,
            "damping": self.gain,
            "joint_stiffness": lambda: self.vector(n, 100.0, 1e4),
            "motor_inertia": lambda: self.vector(n, 0.1, 1.0),
            "reduced_inertia": lambda: self.vector(n, 0.05, 0.5),
            "joint_damping": self.positive,
            "motor_friction": lambda: chance.choice([self.vector(n, 0.0, 1.0), "al.StickSlip(coulomb=0.5)"]),
            **dict.fromkeys(["coulomb", "static", "stribeck_speed", "viscous", "load_ratio"], lambda: self.vector(n, 0.0, 1.0)),
            "frame": lambda: repr(self.frame or "link1"),
            "parent": lambda: repr(self.frame or "link1"),
            "reference": lambda: repr("base" if target == "RelativeTask" else self.frame),
            "force_frame": lambda: chance.choice(["None", repr(self.frame)]),
            "wrench_frame": lambda: repr(self.frame),
            "wrench": lambda: self.vector(6),
            "force": lambda: chance.choice([self.vector(2), self.vector(3), f"[(0.0, {self.vector(2)}), (0.01, {self.vector(2)})]"]),
            "axes": lambda: self.text("xy", "x", "xyz", "xyz rx ry rz", "rx"),
            "axis": lambda: self.vector(3),
            "spline": lambda: self.text("cubic", "quintic", "natural", "linear"),
            "convention": lambda: self.text("standard", "modified"),
            "bandwidth": lambda: self.positive(0.1, 50.0),
            "side": lambda: self.text("lower", "upper"),
            "keep": lambda: self.text("all", "final", "metrics"),
            "part": lambda: self.text("step", "rates", "law", "segment1", "values", "along_plant"),
            "stage": lambda: self.text("recorded", "simplified", "lowered", "machine"),
            "batch": lambda: self.text("True", "False").strip("'"),
            "loop": lambda: chance.choice([self.scenario(), f"({self.plant()}, {self.law()})"]),
            "controls": lambda: chance.choice(["None", '{"law.kp": (0.1, 500.0)}', '{"q0[0]": (-3.0, 3.0)}']),
            "by": lambda: self.text("worst", "mean"),
            "method": self.of_method(target),
            "t_end": lambda: self.positive(0.0, 0.05),
            "dt": lambda: self.positive(1e-3, 1e-2),
            "duration": lambda: self.positive(0.05, 3.0),
            "t": lambda: self.number(0.0, 1.0),
            "t_eval": lambda: "np.linspace(0.0, 0.01, 5)",
            "sample_time": lambda: chance.choice([self.positive(1e-3, 1e-2), self.sampling()]),
            "period": lambda: self.positive(1e-3, 1e-2),
            "frequency": lambda: self.positive(0.1, 100.0),
            "rtol": lambda: self.positive(1e-9, 1e-3),
            "atol": lambda: self.positive(1e-9, 1e-3),
            "record_every": self.count,
            "threads": lambda: self.text("1", "2").strip("'"),
            "draws": self.count,
            "chunk": self.count,
            "candidates": lambda: "4",
            "generations": lambda: "1",
            "samples": lambda: self.count(60),
            "grid": lambda: self.count(60),
            "seed": self.count,
            "restarts": self.count,
            "iterations": lambda: self.count(3),
            "harmonics": lambda: self.count(3),
            "starts": lambda: self.count(2),
            "max_iterations": lambda: self.count(30),
            "tau_max": lambda: self.vector(n, 1.0, 50.0) if not target.endswith("_time") else self.positive(0.0, 20.0),
            "v_max": lambda: self.vector(n, 0.5, 5.0),
            "a_max": lambda: self.vector(n, 0.5, 5.0),
            "wrench_max": lambda: self.vector(2, 1.0, 50.0),
            "feedforward": lambda: self.vector(2),
            "integral_gain": lambda: self.gain(2),
            "nullspace": lambda: f"al.NullSpace({self.vector(n)}, {self.gain()}, 1.0, projection={self.text('consistent', 'static')})",
            "projection": lambda: self.text("consistent", "static"),
            "compensate_coupling": lambda: self.text("True", "False").strip("'"),
            "j_max": lambda: self.vector(n, 0.5, 50.0),
            "v_min": lambda: self.vector(n, -5.0, -0.5),
            "q_min": lambda: self.vector(n, -5.0, -0.5),
            "q_max": lambda: self.vector(n, 0.5, 5.0),
            "tip_speed": lambda: self.positive(0.05, 5.0),
            "tip_acceleration": lambda: self.positive(0.05, 50.0),
            "torque_rate": lambda: self.vector(n, 10.0, 500.0),
            "knots": lambda: "np.linspace(0.0, 1.0, 4)",
            "stops": lambda: "[1]" if target == "time_path" else "al.JointStops(1e3, 1.0, lower=-1.0, upper=1.0)",
            "mimic": lambda: self.text("joined", "independent"),
            "loss": lambda: chance.choice(["{'error_rms': 1.0, 'tau_rms': 0.1}", "lambda run: np.sum(run.q[-1] ** 2)"]),
            "names": lambda: chance.choice(["'q0'", "['law.kp', 'q0']", "'arm.parameters'"]),
            "sensitivity": lambda: chance.choice(["'q0'", "['law.kp', 'v0']", "'arm.parameters'"]),
            "poses": lambda: self.matrix(3, 6),
            "tolerance": self.positive,
            "blend": lambda: self.positive(0.0, 0.1),
            "arcs": lambda: chance.choice(["[1]", "()"]),
            "lengths": lambda: self.vector(n, 0.1, 1.0),
            "masses": lambda: self.vector(n, 0.1, 1.0),
            "coms": lambda: self.vector(n, 0.1, 1.0),
            "inertias": lambda: self.vector(n, 0.1, 1.0),
            "gravity": lambda: self.vector(chance.choice([2, 3])),
            "joints": lambda: self.of_joints(target),
            "rows": lambda: "[1, 1]" if target == "PrioritySolver" else f"[[0.1, 0.2, 0.3, {self.number()}]] * {n}",
            "jacobians": lambda: f"[{self.matrix(1, n)}]{'' if target == 'PrioritySolver.solve' else ' * 2'}",
            "velocities": lambda: "[[0.5], [0.2]]" if target == "solve_priority" else "[[0.5]]",
            "rhs": lambda: "[[0.5], [0.2]]",
            "tasks": self.tasks,
            "pi": lambda: f"{self.arm}.parameters * {self.positive(0.5, 1.5)}",
            "path": lambda: self.matrix(4, n) if target == "time_path" else "'out.bin'",
            "path_or_xml": lambda: f"al.example_urdf({self.text('planar_2r', 'six_axis', 'two_arms')})",
            "name": lambda: self.text("planar_2r", "six_axis", "tool", "error_rms", "dopri5"),
            "vary": lambda: self.text("{'law.gamma': [1.0, 2.0]}", "{'run.q0[0]': {'linspace': [0.0, 0.2, 3]}}").strip('"'),
            "over": lambda: "{'arm.A': [1.5, 2.5]}",
            "cost": lambda: self.text("error_rms1", "settling_time"),
            "data": lambda: repr(SCENARIO),
            "changes": lambda: "{'law.gamma': 3.0}",
            "out": lambda: self.of_out(target),
            "events": lambda: chance.choice(["[al.Event.joint(0, 0.01)]", "lambda t, q, v: q[0] - 0.01"]),
            "runs": lambda: f"[{self.run()}]",
            "run": self.run,
            "log": lambda: f"al.read_log({self.run()})",
            "progress": lambda: "lambda done, total: None",
            "fig": lambda: "Figure()",
            "executor": lambda: "None",
            "index": lambda: self.count(2),
            "other": lambda: chance.choice([self.arm, "None", "3"]),
            "against": self.odd,
            "model": self.odd,
            "keywords": lambda: "",
            "metrics": lambda: "",
            "normal": lambda: self.vector(3),
            "point": lambda: self.vector(3),
            "value": self.number,
            "joint": lambda: self.count(n - 1),
            "g": lambda: "lambda t, q, v: q[0]",
            "kind": lambda: self.text("joint", "speed", "plane", "contact"),
            "noise": lambda: "{'v': 0.01}" if target == "Sampling" else self.positive(0.0, 0.1),
            "resolution": lambda: "{'q': 1e-4}" if target == "Sampling" else self.positive(0.0, 0.1),
            "x0": lambda: self.vector(n),
            "u0": lambda: self.vector(n),
            "inertia": lambda: "np.eye(3) * 0.1" if target == "Arm.with_payload" else self.positive(0.5, 3.0),
            "state": lambda: self.vector(3),
            "s": lambda: self.vector(3, 0.0, 1.0),
            "functions": lambda: self.text("['gravity']", "['bias', 'regressor']", "['pose']").strip('"'),
            "ramp": lambda: self.positive(0.01, 0.5),
            "animate": lambda: "",
        }
        return plain[name]() if name in plain else None

    def of_method(self, target: str) -> Callable[[], str]:
        if target.startswith("simulate") or target == "Simulator":
            return lambda: self.text(*METHODS["fixed"], *METHODS["adaptive"])
        return lambda: self.text(*METHODS["priority"])

    def of_joints(self, target: str) -> str:
        if target == "Arm.locked":
            return "{'joint1': 0.5}"
        if target == "Arm.from_chain":
            return '[{"type": "R", "axis": [0, 0, 1], "rpy": [0, 0, 0], "xyz": [0.1, 0, 0], "phi": [1, .1, 0, 0, .2, 0, 0, .2, 0, .2]}] * 2'
        return "['joint1']"

    def of_out(self, target: str) -> str:
        if target == "sweep":
            return "'out'"
        if target == "simulate_batch":
            return f"{{'q': np.zeros(({self.rows}, 3, {self.n}))}}"
        if target == "Arm.linearize":
            return f"(np.zeros((2 * {self.n}, 2 * {self.n})), np.zeros((2 * {self.n}, {self.n})))"
        if target.endswith("derivatives"):
            return f"tuple(np.zeros(({self.n}, {self.n})) for _ in range(3))"
        shape = self.chance.choice([f"({self.n},)", f"({self.n}, {self.n})", f"(6, {self.n})", "(3,)", "(4, 4)"])
        return f"np.zeros({shape})"

    def of_integrate(self, name: str) -> str | None:
        plain = {
            "f": lambda: self.chance.choice(["lambda t, y: -np.asarray(y)", "lambda t, y: [y[1], -y[0]]", "lambda t, y: np.zeros(7)"]),
            "t_span": lambda: f"(0.0, {self.positive(0.01, 1.0)})",
            "y0": lambda: self.vector(2),
            "method": lambda: self.text(*METHODS["fixed"], *METHODS["adaptive"]),
            "dt": lambda: self.positive(1e-3, 1e-1),
            "rtol": lambda: self.positive(1e-9, 1e-3),
            "atol": lambda: self.positive(1e-9, 1e-3),
            "jac": lambda: self.chance.choice(["np.array([[-1.0, 0.0], [0.0, -1.0]])", "lambda t, y: -np.eye(2)"]),
            "args": lambda: "()",
            "max_step": lambda: self.positive(0.01, 1.0),
            "first_step": lambda: self.positive(1e-4, 1e-2),
            "t_eval": lambda: "np.linspace(0.0, 0.01, 5)",
            "events": lambda: "lambda t, y: y[0] - 0.5",
            "positions": lambda: self.text("0", "1").strip("'"),
            "name": lambda: self.text(*METHODS["adaptive"]),
        }
        return plain[name]() if name in plain else None

    def by_type(self, annotation: str) -> str | None:
        words: list[tuple[str, Callable[[], str]]] = [
            ("Iterable[Task]", self.tasks),
            ("Sequence[Run]", lambda: f"[{self.run()}]"),
            ("Scenario", self.scenario),
            ("BatchRun", self.run),
            ("Motion", self.motion),
            ("Law", self.law),
            ("Plant", self.plant),
            ("ElasticArm", self.plant),
            ("Wall", lambda: self.instance("Wall")),
            ("BaseParameters", lambda: self.instance("BaseParameters")),
            ("TorqueSensor", lambda: self.instance("TorqueSensor")),
            ("Arm", lambda: self.arm),
            ("Callable", lambda: "lambda *a: 0.0"),
            ("bool", lambda: self.text("True", "False").strip("'")),
            ("ArrayLike", lambda: self.chance.choice([self.vector(self.n), self.vector(3), self.positive()])),
            ("float", self.positive),
            ("_Number", self.positive),
            ("int", self.count),
            ("str", lambda: self.text("x", "link1", "joint1")),
        ]
        return next((make() for word, make in words if word in annotation), None)
