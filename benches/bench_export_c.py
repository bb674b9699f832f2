"""ratio = time of a step of exported C / time of that step in armlet, for loops and laws of seven axes.

The first target compares equal work: one step of the adaptive loop by Euler's method. The step evaluates the law, the rates of its 70
estimates and the forward dynamics, and updates the state. The C calls `law_step` and `arm_forward_dynamics` and adds twice. armlet calls
`simulate`. Both must reach the same final state.

The second target compares laws alone. The C is compiled with the options of its CMake file. `law_step` evaluates the motion and computes
the torque. For an adaptive law it also computes the rates of the 70 estimates and advances them. armlet's time is that of `law(t, q, v)`
from Python, which evaluates the motion and computes the torque only. The cost of a Python call is subtracted from it. This cost is
measured with a law of one joint: time of the call minus time of its C step. The system clock times each step of C separately. So each of
these figures includes one reading of the clock.

    python -P benches/bench_export_c.py --readme             # the tables, written into benches/README.md
    python -P benches/bench_export_c.py --steps 100000       # fewer steps
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import reporting
import timing

import armlet as al

GOAL = 1.1
# Number of calls per round, in C and in Python.
CALLS = 2000

#: C code at the start of both programs: a function that reads the clock, in ns.
CLOCK = """
#define _POSIX_C_SOURCE 199309L
#include "law.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void)
{
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return 1e9 * (double)at.tv_sec + (double)at.tv_nsec;
}
"""

DRIVER = (
    CLOCK
    + """
/* Steps in a row, their mean; then one by one, how many took so many ns. */
int main(int count, char **arguments)
{
    static long took[1000];
    const long steps = count > 1 ? atol(arguments[1]) : 1000000L;
    law_state state;
    double q[LAW_N], v[LAW_N], tau[LAW_N], best = 1e30, worst = 0.0, sum = 0.0;
    long k, round, beyond = 0, seen = 0;
    int i, part = 0;
    const double parts[3] = {0.5, 0.99, 0.9999};
    for (i = 0; i < LAW_N; i++) {
        q[i] = 0.1 * i;
        v[i] = 0.2 - 0.05 * i;
    }
    law_init(&state);
    for (round = 0; round < 20; round++) {
        const double start = now();
        for (k = 0; k < CALLS; k++)
            if (law_step(&state, 1e-3 * (double)(CALLS * round + k), q, v, tau) != LAW_OK)
                return 1;
        const double each = (now() - start) / CALLS;
        best = each < best ? each : best;
    }
    law_init(&state);
    for (k = 0; k < steps; k++) {
        const double start = now();
        const int status = law_step(&state, 1e-3 * (double)k, q, v, tau);
        const double each = now() - start;
        if (status != LAW_OK)
            return 1;
        sum += tau[0];
        worst = each > worst ? each : worst;
        took[each < 9990.0 ? (int)(each / 10.0) : 999]++;
        beyond += each > 10000.0;
    }
    printf("%.1f %.0f %ld", best, worst, beyond);
    for (i = 0; i < 1000 && part < 3; i++)
        for (seen += took[i]; part < 3 && (double)seen >= parts[part] * (double)steps; part++)
            printf(" %d", 10 * i + 10);
    printf(" %g\\n", sum);
    return 0;
}
"""
)

LOOP = (
    CLOCK
    + """
#include "arm/arm.h"

/* Runs of a loop by Euler's method: ns per step, and where it ends. */
int main(int count, char **arguments)
{
    const long steps = count > 1 ? atol(arguments[1]) : 1000L;
    law_state state;
    double q[LAW_N], v[LAW_N], a[LAW_N], tau[LAW_N], best = 1e30;
    long k, round;
    int i;
    for (round = 0; round < 20; round++) {
        const double start = now();
        double each;
        law_init(&state);
        for (i = 0; i < LAW_N; i++) {
            q[i] = 0.1 * i;
            v[i] = 0.0;
        }
        for (k = 0; k < steps; k++) {
            if (law_step(&state, LAW_DT * (double)k, q, v, tau) != LAW_OK || arm_forward_dynamics(q, v, tau, a) != ARM_OK)
                return 1;
            for (i = 0; i < LAW_N; i++) {
                q[i] += LAW_DT * v[i];
                v[i] += LAW_DT * a[i];
            }
        }
        each = (now() - start) / (double)steps;
        best = each < best ? each : best;
    }
    printf("%.1f", best);
    for (i = 0; i < LAW_N; i++)
        printf(" %.17g", q[i]);
    printf("\\n");
    return 0;
}
"""
)

ARM = al.load_urdf(al.example_urdf("seven_axis"))
MOTION = al.Sinusoid([0.3] * 7, [0.2] * 7, [2.0] * 7, [0.0] * 7)
SMALL = al.PDGravity(al.pendulum(0.3, 2.0), [0.5], kp=4.0, kd=1.0)
LAWS: dict[str, al.Law] = {
    "ComputedTorque": al.ComputedTorque(ARM, MOTION, 100.0, 20.0),
    "Adaptive": al.Adaptive(ARM, MOTION, kp=40.0, kd=20.0, gamma=1e-6),
}


def compiled(law: al.Law, folder: Path, driver: str = DRIVER, more: Sequence[Path] = ()) -> Path:
    """Compile a program from the C of a law, a driver and further sources; return its path."""
    compiler = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
    if compiler is None:
        raise SystemExit("bench_export_c: no C compiler is installed: expected gcc, clang or cc")
    files = al.export_c(law, folder, dt=1e-3)
    (folder / "main.c").write_text(driver.replace("CALLS", str(CALLS)))
    lines = re.findall(r"PRIVATE (-.*)\)", files[2].read_text())
    options = [option for line in lines for option in line.split() if option != "-march=native"]
    sources = [str(path) for path in (folder / "main.c", files[1], *more)]
    command = [compiler, "-std=c99", *options, *sources, "-o", str(folder / "main"), "-lm"]
    subprocess.run(command, check=True)
    return folder / "main"


def loops(folder: Path, rounds: int) -> tuple[float, float]:
    """Shortest times of one step of the closed loop in C and in armlet, ns."""
    files = al.export_c(ARM, folder / "arm", functions=["forward_dynamics"])
    program = compiled(LAWS["Adaptive"], folder, LOOP, [files[1]])
    plant, q0 = al.RigidArm(ARM), 0.1 * np.arange(7)
    times: dict[str, Any] = {"t_end": 1e-3 * CALLS, "dt": 1e-3, "method": "euler", "record_every": CALLS}
    best = [np.inf, np.inf]
    for _ in range(rounds):
        each, *end = (float(x) for x in subprocess.run([program, str(CALLS)], capture_output=True, text=True, check=True).stdout.split())
        best[0] = min(best[0], each)
        for _ in range(20):
            before = time.perf_counter()
            run = al.simulate(plant, LAWS["Adaptive"], q0, **times, monitors=False, check_limits=False)
            best[1] = min(best[1], 1e9 * (time.perf_counter() - before) / CALLS)
        # C and armlet round sums differently. The difference stays below 1e-9 because the closed loop is contracting.
        np.testing.assert_allclose(end, run.q[-1], rtol=0.0, atol=1e-9)
    return best[0], best[1]


def stepped(program: Path, steps: int) -> list[float]:
    """Mean time of steps in a row, ns.

    Then, of steps timed one by one: longest, number above 10 us, median, 99 % and 99.99 % percentiles, ns.
    """
    done = subprocess.run([str(program), str(steps)], capture_output=True, text=True, check=True).stdout.split()
    return [float(x) for x in done[:6]]


def called(law: al.Law) -> float:
    """Mean time of a call from Python, ns: the smallest mean of ten rounds."""
    n, best = law.arm.n, np.inf
    q, v = 0.1 * np.arange(n), 0.2 - 0.05 * np.arange(n)
    for start in range(10):
        before = time.perf_counter()
        for k in range(CALLS):
            law(1e-3 * (CALLS * start + k), q, v)
        best = min(best, (time.perf_counter() - before) / CALLS)
    return 1e9 * best


def main() -> None:
    parser = reporting.arguments(__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=10_000_000, help="steps that are timed one by one")
    given = parser.parse_args()
    reporting.require_release("bench_export_c")
    timing.pin([given.core])
    with tempfile.TemporaryDirectory() as folder:
        small = compiled(SMALL, Path(folder) / "small")
        programs = {name: compiled(law, Path(folder) / name) for name, law in LAWS.items()}
        alone = {name: stepped(program, given.steps) for name, program in programs.items()}
        # Each round times every law once. The smallest time counts, because other programs can only lengthen a time.
        least = {name: [np.inf, np.inf] for name in (*LAWS, "small")}
        for _ in range(given.rounds):
            for name, law in (LAWS | {"small": SMALL}).items():
                each = stepped(programs.get(name, small), 1)[0], called(law)
                least[name] = [min(pair) for pair in zip(least[name], each, strict=True)]
        python = least["small"][1] - least["small"][0]
        loop = loops(Path(folder) / "loop", given.rounds)
        rows = {name: ([least[name][0], *alone[name][1:]], least[name][1] - python) for name in LAWS}
    ratios = {name: steps[0] / engine for name, (steps, engine) in rows.items()}
    machine = timing.machine()
    targets = {"step of the adaptive loop": loop[0] / loop[1], "step of ComputedTorque alone": ratios["ComputedTorque"]}
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores; armlet {al.__version__}, {al.build_info()['profile']} build.",
        "",
        *reporting.target_table([(f"{name}, C / armlet", f"<= {GOAL}", f"{x:.2f}", x <= GOAL) for name, x in targets.items()]),
        "",
        f"Adaptive loop of seven axes, {CALLS:,} steps of Euler's method: {loop[0]:.0f} ns per step in C, {loop[1]:.0f} ns in armlet.",
        "",
        f"| seven axes, {given.steps:,} steps | armlet, ns | C, ns | ratio | median | 99 % | 99.99 % | longest | beyond 10 us |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, (steps, engine) in rows.items():
        step, worst, beyond, *parts = steps
        shown = " | ".join(f"{x:.0f}" for x in (*parts, worst, beyond))
        lines.append(f"| {name} | {engine:.0f} | {step:.0f} | {ratios[name]:.2f} | {shown} |")
    reporting.finish("export_c", "\n".join(lines), given.readme)
    if max(targets.values()) > GOAL:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
