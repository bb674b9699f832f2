"""Punctuality of a control loop: a law in C and in Python on a clock, with the simulated arm behind a loopback socket.

Run: ``python measure.py [--seconds 10] [--figure latency.png]``

For 1 kHz and 4 kHz, the script runs both controllers, and compares the final state of the robot with `al.simulate`. It prints how late the
cycles began and when their commands were sent. It also prints the number of commands that were sent after the next deadline.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from loop import expected, law, n

import armlet as al

HERE = Path(__file__).resolve().parent


def compiled(folder: Path, rate: float) -> list[str] | None:
    """The command that starts the controller in C, or None if no compiler is installed."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    _, source, _ = al.export_c(law, folder, dt=1.0 / rate)
    program = folder / "controller"
    flags = ["-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror", f"-I{folder}"]
    subprocess.run([compiler, *flags, str(HERE / "controller.c"), str(source), "-o", str(program), "-lm"], check=True)
    return [str(program)]


def measured(controller: list[str], rate: float, samples: int, folder: Path) -> dict[str, np.ndarray]:
    """The arrays that one controller wrote during a run of `samples` samples."""
    with subprocess.Popen([sys.executable, str(HERE / "robot.py"), str(rate)], stdout=subprocess.PIPE, text=True) as robot:
        assert robot.stdout is not None
        try:
            out = folder / "out.npz"
            port = robot.stdout.readline().strip()
            subprocess.run([*controller, port, str(rate), str(samples), str(out)], check=True)
        finally:
            robot.kill()
    if controller[0] == sys.executable:
        return dict(np.load(out))
    values = np.fromfile(out)
    memory, fifo, state, late, done = np.split(values, np.cumsum([1, 1, 1 + 2 * n, samples]))
    return {"late": late, "done": done, "state": state, "memory locked": memory, "SCHED_FIFO": fifo}


def report(name: str, rate: float, found: dict[str, np.ndarray]) -> str:
    """One row of the table, in microseconds."""
    missed = int(np.sum(found["done"] > 1.0 / rate))
    permitted = ", ".join(what for what in ("memory locked", "SCHED_FIFO") if found[what].any()) or "nothing"
    late, done = (1e6 * np.quantile(found[what], [0.5, 0.99, 1.0]) for what in ("late", "done"))
    figures = " ".join(f"{value:9.0f}" for value in (*late, *done))
    return f"{name:8} {rate / 1e3:3g} kHz {figures}  {missed:6} of {found['done'].size}   {permitted}"


def draw(results: dict[tuple[str, float], dict[str, np.ndarray]], file: str) -> None:
    """A histogram of the times at which commands were sent, for each rate."""
    import matplotlib.pyplot as plt

    rates = sorted({rate for _, rate in results})
    fig, axes = plt.subplots(1, len(rates), figsize=(9.0, 3.4), sharey=True, layout="constrained")
    edges = np.geomspace(1.0, 1e5, 80)
    for ax, rate in zip(axes, rates, strict=True):
        for (name, its), found in results.items():
            if its == rate:
                ax.hist(1e6 * found["done"], edges, histtype="step", label=name)
        ax.axvline(1e6 / rate, color="black", linestyle=":", label="next deadline")
        ax.set(xscale="log", yscale="log", title=f"{rate / 1e3:g} kHz", xlabel="command sent after the deadline (µs)")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("cycles")
    axes[0].legend()
    fig.savefig(file, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description="how punctual a loop of armlet is")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each run")
    parser.add_argument("--figure", help="where the histograms go")
    given = parser.parse_args()
    print("us after the deadline:   begun                         sent")
    print("                        median      99 %     worst    median      99 %     worst  missed           permitted")
    results = {}
    for rate in (1e3, 4e3):
        samples = max(1, round(given.seconds * rate))
        end = expected(rate, samples)
        with tempfile.TemporaryDirectory() as folder:
            controllers = {"C": compiled(Path(folder), rate), "Python": [sys.executable, str(HERE / "controller.py")]}
            for name, controller in controllers.items():
                if controller is None:
                    print("C        no compiler is installed: expected cc, gcc or clang")
                    continue
                found = measured(controller, rate, samples, Path(folder))
                difference = float(np.abs(found["state"][1:] - end).max())
                # The controller in C equals armlet to the last bit. The controller in Python adds up its estimates in another order.
                assert difference <= (0.0 if name == "C" else 1e-9), f"{name}: the states differ by {difference:.1e}"
                results[name, rate] = found
                print(report(name, rate, found), flush=True)
    if given.figure:
        draw(results, given.figure)


if __name__ == "__main__":
    main()
