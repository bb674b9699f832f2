"""Python source of numbers, arrays and objects of armlet. One random generator determines all choices."""

from __future__ import annotations

import random
from collections.abc import Callable

from tables import ARMS, ODD, SCENARIO


class Objects:
    """Source texts of numbers and objects of armlet for one call. All objects use one arm."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.arm, self.n, self.frame = chance.choice(ARMS)
        self.rows = chance.choice([1, 1, 2, 3])
        self.method = ""

    # Numbers and arrays.

    def number(self, low: float = -2.0, high: float = 2.0) -> str:
        return self.chance.choice([repr(round(self.chance.uniform(low, high), 3))] * 6 + ["0.0", repr(low), repr(high)])

    def positive(self, low: float = 0.1, high: float = 50.0) -> str:
        return repr(round(self.chance.uniform(low, high), 4))

    def count(self, high: int = 5) -> str:
        return repr(self.chance.randint(0, high))

    def vector(self, n: int, low: float = -2.0, high: float = 2.0, batch: bool = False) -> str:
        row = f"[{', '.join(self.number(low, high) for _ in range(n))}]"
        if batch and self.chance.random() < 0.3:
            row = f"[{', '.join([row] * self.rows)}]"
        return self.chance.choice([row, f"np.array({row})", f"np.array({row})", f"np.array({row}, dtype=np.float32)", f"tuple({row})"])

    def matrix(self, rows: int, columns: int, low: float = -2.0, high: float = 2.0) -> str:
        return f"np.array([{', '.join('[' + ', '.join(self.number(low, high) for _ in range(columns)) + ']' for _ in range(rows))}])"

    def gain(self, n: int | None = None) -> str:
        n = self.n if n is None else n
        return self.chance.choice([self.positive(), self.vector(n, 1.0, 50.0), f"np.diag({self.vector(n, 1.0, 50.0)})"])

    def text(self, *names: str) -> str:
        return repr(self.chance.choice(names))

    def odd(self) -> str:
        return self.chance.choice(ODD)

    # Sources of objects that armlet's classes and functions require as arguments.

    def motion(self) -> str:
        q0, q1 = self.vector(self.n), self.vector(self.n)
        return self.chance.choice(
            [
                f"al.Hold({q0})",
                f"al.Quintic({q0}, {q1}, {self.positive(0.1, 2.0)})",
                f"al.BangBang({q0}, {q1}, {self.positive(0.1, 2.0)})",
                f"al.Sinusoid({q0}, {q1}, {self.vector(self.n)}, {self.vector(self.n)})",
            ]
        )

    def plant(self) -> str:
        elastic = f"al.ElasticArm({self.arm}, {self.vector(self.n, 100.0, 1e4)}, {self.vector(self.n, 0.1, 1.0)})"
        wall = f"wall=al.Wall('{self.frame}', [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], stiffness=1e3)" if self.frame else "friction=True"
        stops = "stops=al.JointStops(1e3, 1.0, lower=-1.0, upper=1.0)"
        bristles = "al.LuGre(coulomb=1.0, static=2.0, stribeck_speed=0.1, stiffness=300.0, damping=1.0, load_ratio=0.1)"
        sticks = "al.StickSlip(coulomb=1.0, static=1.5, load_ratio=0.1)"
        dry = [f"al.RigidArm({self.arm}, friction={each})" for each in (bristles, sticks)]
        dry.append(elastic[:-1] + f", motor_friction={self.chance.choice([bristles, sticks])})")
        return self.chance.choice(
            [f"al.RigidArm({self.arm})"] * 3
            + dry
            + [f"al.RigidArm({self.arm}, {wall})", f"al.RigidArm({self.arm}, {stops})", elastic, f"al.VelocityArm({self.arm})"]
        )

    def law(self) -> str:
        n, arm = self.n, self.arm
        rigid = [
            f"al.PID({arm}, {[0.1] * self.n}, {self.gain()}, {self.gain()}, {self.gain()}, {self.gain()})",
            f"al.PID({arm}, {self.motion()}, {self.gain()}, None, {self.gain()}, derivative_filter={self.positive()}, "
            f"friction=True, observer_bandwidth={self.positive()})",
            f"al.ComputedTorque({arm}, {self.motion()}, {self.gain()}, {self.gain()})",
            f"al.PDGravity({arm}, {self.vector(n)}, {self.gain()}, {self.gain()})",
            f"al.Adaptive({arm}, {self.motion()}, {self.gain()}, {self.gain()}, {self.positive()})",
            f"al.Adaptive({arm}, {self.motion()}, {self.gain()}, {self.gain()}, 1.0, friction=True, armature=True, leakage=0.1)",
            f"al.Guarded(al.PDGravity({arm}, {self.vector(n)}, 50.0, 9.0), al.MomentumObserver({arm}, 50.0, threshold=1.0))",
            f"al.MotorPD({arm}, {self.vector(n)}, 500.0, 20.0, {self.vector(n, 100.0, 1e4)})",
            f"al.JointTracking({arm}, al.Quintic({self.vector(n)}, {self.vector(n)}, 1.0), 500.0, 20.0, {self.vector(n, 100.0, 1e4)}, 0.5)",
            f"al.JointImpedance({arm}, {self.vector(n)}, {self.gain()}, {self.gain()}, {self.vector(n, 100.0, 1e4)}, 0.5, 0.2)",
        ]
        if self.frame:
            rigid.append(f"al.CartesianImpedance({arm}, [0.3, 0.2], 100.0, 10.0, frame='{self.frame}', axes='xy')")
            posture = f"nullspace=al.NullSpace({[0.1] * n}, 10.0, 1.0), feedforward=[1.0], compensate_coupling=True, integral_gain=2.0"
            rigid.append(f"al.CartesianImpedance({arm}, [0.3], 100.0, 10.0, frame='{self.frame}', axes='x', {posture})")
            rigid.append(f"al.PriorityVelocity({arm}, {self.tasks()})")
        return self.chance.choice(rigid)

    def task(self) -> str:
        made = [
            f"al.PostureTask({self.vector(self.n)}, {self.positive()})",
            "al.JointLimitTask(1.0, 0.1)",
            "al.CentreOfMassTask('x', [0.2], 1.0)",
        ]
        if self.frame:
            made += [
                f"al.Task('{self.frame}', 'xy', [0.4, 0.1], 2.0)",
                f"al.AxisTask('{self.frame}', [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0)",
            ]
        return self.chance.choice(made)

    def tasks(self) -> str:
        return f"[{', '.join(self.task() for _ in range(self.chance.randint(1, 3)))}]"

    def loop(self) -> str:
        return f"al.RigidArm({self.arm}), al.ComputedTorque({self.arm}, al.Hold({[0.1] * self.n}), 50.0, 10.0), {[0.0] * self.n}"

    def single(self) -> str:
        how = self.chance.choice(["dt=5e-3", "method='dopri5', dense=True, events=[al.Event.joint(0, 0.001)]"])
        return f"al.simulate({self.loop()}, t_end=0.02, {how})"

    def batch(self) -> str:
        return f"al.simulate_batch({self.loop().rpartition('[')[0]}{[[0.0] * self.n] * 2}, t_end=0.02, dt=5e-3)"

    def limits(self) -> str:
        zero = [0.0] * self.n
        law = f"al.JointImpedance({self.arm}, {zero}, 100.0, 10.0, 1e4, 0.5, 0.2)"
        return f"al.elastic_limits(al.ElasticArm({self.arm}, 1e4, 0.5), {law}, q0={zero})"

    def run(self) -> str:
        return self.chance.choice([self.single, self.single, self.batch])()

    def scenario(self) -> str:
        return f"al.Scenario({SCENARIO!r})"

    def sampling(self) -> str:
        sensor = ", torque_sensor=al.TorqueSensor(noise=0.1)" if self.chance.random() < 0.2 else ""
        return f"al.Sampling(5e-3, delay=1e-3, noise={{'v': 0.01}}, seed={self.count()}{sensor})"

    def instance(self, owner: str) -> str:
        """The source of an object of the class `owner`, whose method is called."""
        link = f"{self.number()}, {self.number()}, 1.2, 5.0, {self.positive(1.0, 20.0)}"
        made: dict[str, Callable[[], str]] = {
            "Arm": lambda: self.arm,
            "MomentumObserver": lambda: f"al.MomentumObserver({self.arm}, {self.gain()}, threshold=0.1)",
            "Law": self.law,
            "Motion": self.motion,
            "Plant": self.plant,
            "Task": self.task,
            "Run": self.single,
            "Log": lambda: f"al.read_log({self.single()})",
            "LogReport": lambda: f"al.read_log({self.single()}).report",
            "LogFit": lambda: (
                f"al.fit_log({self.arm}, al.Log(np.arange(400) * 0.01, *np.random.default_rng(0).normal(size=(1, 400, {self.n})), "
                f"tau=np.random.default_rng(1).normal(size=(400, {self.n}))), ['viscous'])"
            ),
            "BatchRun": self.batch,
            "Scenario": self.scenario,
            "SweepTable": lambda: f"al.sweep({self.scenario()}, {{'law.gamma': [1.0, 2.0]}})",
            "LoopMargins": lambda: f"al.loop_margins({self.loop()}, sample_time=1e-3)",
            "LoopProgram": lambda: f"al.loop_program({self.loop().rpartition('[')[0]}method='euler')",
            "Metrics": lambda: f"al.metrics({self.run()})",
            "Simulator": lambda: f"al.Simulator({self.loop()}, dt=1e-3)",
            "PrioritySolver": lambda: f"al.PrioritySolver({self.n}, [1], method='clamp')",
            "ArmPrioritySolver": lambda: f"al.PrioritySolver.for_arm({self.arm}, {self.tasks()})",
            "PrioritySolution": lambda: f"al.solve_priority([np.eye({self.n})[:1]], [[0.5]])",
            "PriorityDiagnosis": lambda: f"al.diagnose_priority([np.eye({self.n})[:1]])",
            "BangBangReport": lambda: f"al.bang_bang_time({link})",
            "BangBangBatch": lambda: f"al.bang_bang_time([0.0, 0.5], [1.0, 1.5], 1.2, 5.0, {self.positive(1.0, 20.0)})",
            "ProfileReport": lambda: f"al.{self.chance.choice(['trapezoid_time', 'minimum_jerk_time'])}({link})",
            "TorqueOptimum": lambda: f"al.torque_optimal_time({link})",
            "TimedPath": lambda: f"al.point_to_point({[0.0] * self.n}, {self.vector(self.n, 0.5, 1.0)}, 1.0, 2.0, 10.0)",
            "InverseKinematics": lambda: f"al.inverse_kinematics({self.arm}, {self.tasks()}, {[0.1] * self.n}, max_iterations=20)",
            "SuggestedGains": lambda: f"al.suggest_gains({self.arm}, 10.0)",
            "BaseParameters": lambda: f"{self.arm}.base_parameters()",
            "ParameterReport": lambda: f"{self.arm}.check_parameters()",
            "Identification": lambda: f"{self.arm}.identify(*(np.random.default_rng(i).normal(size=(40, {self.n})) for i in range(4)))",
            "Integration": lambda: "al.integrate(lambda t, y: -y, (0.0, 1.0), [1.0, 2.0], dense_output=True)",
            "DenseOutput": lambda: "al.integrate(lambda t, y: -y, (0.0, 1.0), [1.0, 2.0], dense_output=True).dense",
            "Events": lambda: f"al.simulate({self.loop()}, t_end=0.1, method='dopri5', events=[al.Event.joint(0, 0.01)]).events",
            "State": lambda: f"al.simulate({self.loop()}, t_end=0.1, method='dopri5', dense=True).sample(0.05)",
            "Equilibrium": lambda: f"al.equilibrium({self.loop().rpartition('[')[0]}q0={[0.0] * self.n})",
            "ElasticLimits": self.limits,
            "Event": lambda: "al.Event.joint(0, 0.5)",
            "JointStops": lambda: "al.JointStops(1.0)",
            "LuGre": lambda: "al.LuGre(coulomb=1.0, stiffness=300.0)",
            "StickSlip": lambda: "al.StickSlip(coulomb=1.0)",
            "Sensitivity": lambda: f"al.simulate({self.loop()}, t_end=0.01, dt=1e-3, sensitivity='q0').sensitivity['q0']",
            "ExcitingMotion": lambda: "al.ExcitingMotion([0.0], [[0.5, 0.2]], [[1.0, 2.0]], [[0.3, 0.1]], 6.0, 3.5, [0.1, 0.2])",
            "NullSpace": lambda: f"al.NullSpace({[0.1] * self.n}, 10.0, 1.0)",
            "Sampling": self.sampling,
            "TorqueSensor": lambda: "al.TorqueSensor()",
            "Status": lambda: "al.Status.SUCCESS",
            "Tuning": lambda: f"al.tune({self.scenario()}, {{'law.gamma': [1.0, 5.0]}}, 'error_rms1', candidates=4, generations=1)",
            "WorstCase": lambda: f"al.worst_case({self.scenario()}, {{'law.gamma': [1.0, 5.0]}}, 'error_rms', runs=8)",
            "Wall": lambda: "al.Wall('link2', [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], stiffness=1e3)",
            "RigidArm": lambda: f"al.RigidArm({self.arm})",
        }
        return made[owner]() if owner in made else f"al.{owner}"
