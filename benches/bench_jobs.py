"""Time of whole jobs of a user, and its ratio to the time of the simulation loops in them: medians over rounds.

A job runs with its defaults, on all cores. Its loop is `simulate_batch(keep="final")` of the same runs, or the simplest call that does
the work. Results are compared first.

    python -P benches/bench_jobs.py              the table
    python -P benches/bench_jobs.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import atexit
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing
from timing import Case

DT = 1e-3
#: Runs and steps of a batch. `FEW` is the number of runs for arms with more than three joints, `RECORDED` for a batch that stores records.
#: A sweep has `CELLS` cells with `CELL_STEPS` steps each.
RUNS, STEPS = 1024, 1000
FEW = 128
RECORDED = 200
CELLS, CELL_STEPS = 4000, 4000
#: Number of rounds. It is small because each case with threads needs 0.1 s of warm-up per round.
ROUNDS = 5
TARGETS, SAMPLES = 256, 20000
ENVIRONMENTS = {"planar 2R": 1024, "seven axes": 1024}
DASK = f"sweep of {CELLS} cells on Dask, two workers"
THREADS = len(timing.cores())
POOL = ThreadPoolExecutor(THREADS)
RNG = np.random.default_rng(21)

PR, TWO, THREE = al.planar_pr(2.0, 0.5, 1.0), al.planar_arm([0.5, 0.4], masses=[3.0, 2.0]), al.planar_arm([0.4, 0.3, 0.2])
SIX, SEVEN = (al.load_urdf(al.example_urdf(name)) for name in ("six_axis", "seven_axis"))
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}


def motion(n: int) -> al.Motion:
    return al.Sinusoid([0.1] * n, [0.2] * n, [1.0 + 0.1 * i for i in range(n)], [0.0] * n)


def loops() -> dict[str, tuple[al.Plant, al.Law]]:
    elastic = al.ElasticArm(TWO, 800.0, 0.4)
    tasks = [al.Task("link3", "xy", [0.5, 0.4], 8.0), al.PostureTask([0.2, 0.3, 0.4], 2.0)]
    swing = al.Sinusoid([0.0, 0.0], [0.5, 0.8], [1.0, 2.0], [0.0, 0.0])
    return {
        "PR, adaptive": (al.RigidArm(PR), al.Adaptive(PR, swing, 50.0, 10.0, [2.0, 1.0, 1.0])),
        "planar 2R, computed torque": (al.RigidArm(TWO), al.ComputedTorque(TWO, motion(2), 100.0, 20.0)),
        "planar 2R, impedance": (al.RigidArm(TWO), al.CartesianImpedance(TWO, [0.6, 0.4], 300.0, 40.0, **TIP)),
        "elastic 2R, impedance": (elastic, al.ElasticImpedance(TWO, [0.6, 0.4], 300.0, 40.0, 800.0, 0.4, 0.1, **TIP)),
        "elastic 2R, motor PD": (elastic, al.MotorPD(TWO, [0.3, 0.6], 300.0, 40.0, 800.0)),
        "3R, priority of velocities": (al.VelocityArm(THREE), al.PriorityVelocity(THREE, tasks)),
        "3R, priority of accelerations": (al.RigidArm(THREE), al.PriorityAcceleration(THREE, tasks)),
        "six axes, computed torque": (al.RigidArm(SIX), al.ComputedTorque(SIX, motion(6), 100.0, 20.0)),
        "seven axes, computed torque": (al.RigidArm(SEVEN), al.ComputedTorque(SEVEN, motion(7), 100.0, 20.0)),
    }


def require_equal(name: str, plant: al.Plant, law: al.Law) -> None:
    """Assert that `keep="metrics"` computes the metrics of the recorded run, and that the last records are equal."""
    q0 = 0.2 + RNG.uniform(-0.05, 0.05, (3, plant.arm.n))
    whole = al.simulate_batch(plant, law, q0, t_end=60 * DT, dt=DT)
    metrics, final = (al.simulate_batch(plant, law, q0, t_end=60 * DT, dt=DT, keep=keep) for keep in ("metrics", "final"))
    assert np.all(whole.status == al.Status.SUCCESS), name
    for other in (metrics, final):
        assert np.array_equal(other.q[:, -1], whole.q[:, -1]), name
    for key, values in whole.metrics().items():
        # The two sums of 60 terms differ in order, and the monitors use fused multiply-adds. Relative differences are about 1e-13.
        assert np.allclose(metrics.metrics()[key], values, rtol=1e-10, atol=1e-12, equal_nan=True), (name, key)


def filled(rows: int, width: int) -> None:
    """Fill new memory of `rows` x `width` numbers once, with as many threads as a batch uses."""
    list(POOL.map(lambda part: part.fill(1.0), np.array_split(np.empty((rows, width)), THREADS)))


def batches(name: str, plant: al.Plant, law: al.Law) -> Iterator[Case]:
    n = plant.arm.n
    rows = RUNS if n <= 3 else FEW
    q0 = 0.2 + RNG.uniform(-0.05, 0.05, (rows, n))

    def run(keep: Any, monitors: bool, steps: int = STEPS, every: int = 1) -> Callable[[], Any]:
        options: dict[str, Any] = {"t_end": steps * DT, "dt": DT, "keep": keep, "monitors": monitors, "record_every": every}
        return lambda: al.simulate_batch(plant, law, q0, **options)

    for monitors in (True, False):
        group = f"{name}, {'with' if monitors else 'without'} monitors: ns per run and step of `simulate_batch`"
        tag = f"{name}{', monitors' if monitors else ''}"
        yield Case(group, f"final, {tag}", run("final", monitors), rows * STEPS, threads=THREADS)
        if monitors:
            yield Case(group, f"metrics, {tag}", run("metrics", True), rows * STEPS, threads=THREADS, against=f"final, {tag}")
        for every in (1, 10) if monitors else (1,):
            steps = every * RECORDED
            records = run("all", monitors, steps, every)
            found = records()
            arrays = [*found.__dict__.values(), *found.monitors.values()]
            width = sum(x[0].size for x in arrays if isinstance(x, np.ndarray) and x.shape[:2] == found.q.shape[:2])
            what = "all" if every == 1 else f"all of every {every}th step"
            fill = f"numpy fills the arrays of {what}, {tag}"
            yield Case(group, fill, lambda width=width: filled(rows, width), rows * steps, threads=THREADS)
            yield Case(group, f"{what}, {tag}", records, rows * steps, threads=THREADS, against=fill)


def scenario(steps: int) -> al.Scenario:
    tables = {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 1.0},
        "motion": {"kind": "Sinusoid", "offset": [0.0, 0.0], "amplitude": [0.5, 0.8], "frequency": [1.0, 2.0], "phase": [0.0, 0.0]},
        "law": {"kind": "Adaptive", "kp": 50.0, "kd": 10.0, "gamma": [2.0, 1.0, 1.0]},
        "run": {"q0": [0.1, -0.2], "t_end": steps * DT, "dt": DT},
    }
    return al.Scenario(tables)


def sweeps() -> Iterator[Case]:
    whole = scenario(CELL_STEPS)
    gains = np.linspace(30.0, 80.0, CELLS).tolist()
    laws = [whole.replace({"law.kp": kp}).build().law for kp in gains]
    plant, q0 = al.RigidArm(PR), np.tile([0.1, -0.2], (CELLS, 1))
    few = al.sweep(scenario(60), {"law.kp": gains[:9]})
    alone = [scenario(60).replace({"law.kp": kp}).run().metrics() for kp in gains[:9]]
    assert np.allclose(few["error_rms2"], [found["error_rms"][1] for found in alone], rtol=1e-9)
    group = f"Searches over runs of the PR robot with {CELL_STEPS} steps: s"
    loop = f"simulate_batch of {CELLS} laws, final"
    yield Case(
        group,
        loop,
        lambda: al.simulate_batch(plant, laws, q0, t_end=CELL_STEPS * DT, dt=DT, keep="final"),
        1,
        "s",
        1.0,
        threads=THREADS,
    )
    yield Case(group, f"sweep of {CELLS} cells", lambda: al.sweep(whole, {"law.kp": gains}), 1, "s", 1.0, threads=THREADS, against=loop)
    yield from on_dask(group, lambda executor: al.sweep(whole, {"law.kp": gains}, executor=executor), loop)
    ranges = {"law.kp": {"uniform": [30.0, 80.0]}, "law.kd": {"uniform": [5.0, 15.0]}}
    some = CELLS // 40

    def tuned() -> Any:
        return al.tune(whole, ranges, "error_rms1", candidates=some, generations=3)

    try:
        tuned()
    except ImportError as missing:
        print(f"skipped: tune: {missing}", file=sys.stderr)
        return
    yield Case(group, f"tune, 4 generations of {some}", tuned, 1, "s", 1.0, threads=THREADS, against=loop)


def on_dask(group: str, swept: Callable[[Any], Any], loop: str) -> Iterator[Case]:
    """The sweep on a Dask cluster of two workers with one thread each. The cluster starts before and stops after the measurement."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as missing:
        print(f"skipped: Dask: {missing}", file=sys.stderr)
        return
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50)
    client = Client(cluster)
    atexit.register(lambda: (client.close(), cluster.close()))
    executor = client.get_executor()
    yield Case(group, DASK, lambda: swept(executor), 1, "s", 1.0, threads=THREADS, against=loop)


def environments() -> Iterator[Case]:
    try:
        from armlet.gym import ArmVectorEnv, Reach
    except ImportError as missing:
        print(f"skipped: armlet.gym: {missing}", file=sys.stderr)
        return
    group = "Steps of environments of 20 ms, ten steps of the arm each: ns per environment and step"
    for name, arm in (("planar 2R", None), ("seven axes", SEVEN)):
        rows = ENVIRONMENTS[name]
        envs = ArmVectorEnv(rows, arm, None if arm is None else Reach(), tau_max=None if arm is None else np.full(7, 20.0))
        envs.reset(seed=0)
        actions = RNG.uniform(-0.1, 0.1, (rows, envs.single_action_space.shape[0]))
        plant = al.RigidArm(arm or al.planar_arm([0.5, 0.5], gravity=[0.0, 0.0]))
        law = al.PDGravity(plant.arm, np.zeros(plant.arm.n), 1.0, 1.0)
        q0 = RNG.uniform(-0.1, 0.1, (rows, plant.arm.n))
        loop = f"simulate_batch of {rows} runs under PD, 0.2 s, {name}"
        options: dict[str, Any] = {"t_end": 0.2, "dt": 2e-3, "keep": "final", "monitors": False}
        yield Case(group, loop, lambda p=plant, w=law, q=q0, o=options: al.simulate_batch(p, w, q, **o), 10 * rows, threads=THREADS)
        step = f"ArmVectorEnv.step, {rows} of {name}"
        yield Case(group, step, lambda e=envs, a=actions: [e.step(a) for _ in range(10)], 10 * rows, threads=THREADS, against=loop)


def models() -> Iterator[Case]:
    q = RNG.uniform(-1.0, 1.0, (TARGETS, 7))
    frame = SEVEN.tip_frame
    targets = SEVEN.position(q, frame)

    def solved() -> list[Any]:
        pairs = zip(targets, q + 0.1, strict=True)
        return [al.inverse_kinematics(SEVEN, [al.Task(frame, "xyz", target)], start) for target, start in pairs]

    found = solved()
    reached = np.array([bool(each) for each in found])
    places = SEVEN.position(np.array([each.q for each in found]), frame)
    assert reached.mean() > 0.9 and np.abs(places - targets)[reached].max() < 1e-4
    group, loop = "Models of seven axes: us per target or sample", "Arm.jacobian, a frame"
    yield Case(group, loop, lambda: SEVEN.jacobian(q, frame), TARGETS, "us", 1e6, threads=THREADS)
    solve = f"inverse_kinematics, {TARGETS} targets one by one"
    yield Case(group, solve, solved, TARGETS, "us", 1e6, threads=THREADS, against=loop)
    states = RNG.uniform(-1.0, 1.0, (3, SAMPLES, 7))
    tau = SEVEN.inverse_dynamics(*states)
    fit = SEVEN.identify(*states, tau)
    assert np.abs(SEVEN.with_parameters(fit.parameters).inverse_dynamics(*states) - tau).max() < 1e-6
    regressor = "Arm.regressor"
    few = states[:, :TARGETS]
    yield Case(group, regressor, lambda: SEVEN.regressor(few[0], few[1], few[1], few[2]), TARGETS, "us", 1e6, threads=THREADS)
    fitted = f"identify from {SAMPLES} samples"
    yield Case(group, fitted, lambda: SEVEN.identify(*states, tau), SAMPLES, "us", 1e6, threads=THREADS, against=regressor)


def shell(folder: Path) -> Iterator[Case]:
    file = folder / "pr.toml"
    file.write_text(
        'arm = { kind = "planar_pr", A = 2.0, B = 0.5, C = 1.0 }\n'
        'motion = { kind = "Hold", q = [0.3, 0.5] }\n'
        'law = { kind = "ComputedTorque", kp = 50.0, kd = 15.0 }\n'
        "run = { q0 = [0.1, -0.2], t_end = 2.0, dt = 1e-3 }\n"
    )
    command = [sys.executable, "-P", "-m", "armlet", "run", str(file)]
    loaded = al.Scenario.load(file)
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "error_rms" in printed and loaded.run().status is al.Status.SUCCESS
    group, loop = "From the shell: ms", "Scenario.run"
    yield Case(group, loop, loaded.run, 1, "ms", 1e3, clock="wall")
    start = "python -c 'import numpy'"
    yield Case(group, start, lambda: subprocess.run([sys.executable, "-P", "-c", "import numpy"], check=True), 1, "ms", 1e3, clock="wall")
    run = "armlet run"
    yield Case(group, run, lambda: subprocess.run(command, capture_output=True, check=True), 1, "ms", 1e3, clock="wall", against=start)


def verdicts(cases: list[Case]) -> Iterator[reporting.Verdict]:
    named = {case.name: case for case in cases}
    for name, case in named.items():
        if name.startswith("metrics, ") and name.endswith(", monitors"):
            yield _ratio(f'keep="metrics" to keep="final", {name[9:]}', case, named[f"final, {name[9:]}"], 1.5)
        if name.startswith("all"):
            what, _, tag = name.partition(", ")
            fill, loop = named[f"numpy fills the arrays of {name}"], named[f"final, {tag}"]
            # A run with monitors that records every step evaluates them at every step. So it is compared with a loop that does this too.
            loop = named.get(f"metrics, {tag}", loop) if what == "all" else loop
            yield _ratio(f"{what} to filling the arrays, {tag}", case, fill, 2.0)
            found = case.median / (loop.median + fill.median)
            yield f"{what} to the loop and filling the arrays, {tag}", "1.5", f"{found:.2f}", found <= 1.5
    seconds = statistics.median(named[f"sweep of {CELLS} cells"].wall.values())
    yield f"sweep of {CELLS} runs of the PR robot with {CELL_STEPS} steps", "0.6 s", f"{seconds:.2f} s", seconds <= 0.6
    if DASK in named:
        seconds = statistics.median(named[DASK].wall.values())
        yield DASK, "1 s", f"{seconds:.2f} s", seconds <= 1.0
    for name, least in (("planar 2R", 1.5e6), ("seven axes", 0.4e6)):
        step = named.get(f"ArmVectorEnv.step, {ENVIRONMENTS[name]} of {name}")
        if step is not None:
            rate = step.per / statistics.median(step.wall.values())
            yield f"environment steps a second, {name}", f"{least:,.0f}", f"{rate:,.0f}", rate >= least


def _ratio(what: str, case: Case, yardstick: Case, most: float) -> reporting.Verdict:
    found = timing.ratio(case, yardstick)
    return what, f"{most:g}", f"{found:.2f}", found <= most


def main() -> None:
    parser = reporting.arguments("what users type, beside the loops inside it")
    parser.set_defaults(rounds=ROUNDS)
    options = parser.parse_args()
    reporting.require_release("bench_jobs")
    share = timing.busy()
    cases: list[Case] = []
    for name, (plant, law) in loops().items():
        require_equal(name, plant, law)
        cases += batches(name, plant, law)
    with tempfile.TemporaryDirectory() as folder:
        for more in (sweeps(), environments(), models(), shell(Path(folder))):
            cases += more
        timing.measure(cases, options.rounds, options.core, lambda text: None)
    met = list(verdicts(cases))
    reporting.finish("jobs", reporting.report(cases, met, share, options.markdown or options.readme), options.readme)


if __name__ == "__main__":
    main()
