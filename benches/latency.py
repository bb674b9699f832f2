"""Latency of Ctrl-C, and longest wait of other threads for the interpreter lock, for each long call of armlet.

Each call runs repeatedly in a separate process. To measure the latency, this process sends SIGINT after a random time, at most the
duration of one call. The latency is the time from the signal to the first line of `except KeyboardInterrupt`. To measure gaps, a thread
of the child process sleeps for half a millisecond at a time while the call runs. The gap is the longest time between two wake-ups.

    make test-latency                                 # all calls, 100 signals each: 40 minutes; prints the table, fails past a limit
    python -P benches/latency.py --only time_path     # the calls whose names contain this word
    python -P benches/latency.py --readme             # the table as Markdown, also written into benches/README.md
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import timing
from latency_cases import CASES, COMMON
from reporting import write_figures

import armlet as al

ROW = "| {:50} | {:>8} | {:>9} | {:>9} | {:>7} | {} |"
# Limits: 99th percentile of the latency, and longest gap, s.
LATENCY, GAP = 0.100, 0.050
# To measure gaps, a call is repeated at most this often, and for at most this many seconds.
REPEATS, LONGEST = 5, 8.0
# A call that does not answer the signal is terminated after this time, s.
LOST = 60.0
# A call that takes longer than this time counts as endless, s.
ENDLESS = 20.0

CHILD = """
import json, signal, sys, threading, time
setup, call, scale, repeats, longest = json.loads(sys.argv[1])
signal.signal(signal.SIGINT, signal.default_int_handler)
size = lambda n: max(1, int(n * scale))
space = {"size": size}
exec(setup, space)
run = eval(f"lambda: ({call})", space)
turns, over = [], threading.Event()
def ticks():
    last = time.perf_counter()
    while not over.is_set():
        time.sleep(5e-4)
        now = time.perf_counter()
        turns.append(now - last)
        last = now
ticker = threading.Thread(target=ticks)
ticker.start()
began, count = time.perf_counter(), 0
try:
    while count < repeats and (count == 0 or time.perf_counter() - began < longest):
        run()
        count += 1
except KeyboardInterrupt:
    # A call without an end is ended from outside.
    pass
finally:
    took = (time.perf_counter() - began) / max(count, 1)
    over.set()
    ticker.join()
print(json.dumps([took, max(turns, default=0.0)]), flush=True)
for line in sys.stdin:
    answered = None
    try:
        print("go", flush=True)
        while True:
            run()
    except KeyboardInterrupt:
        answered = time.perf_counter()
    print(answered, flush=True)
"""


class Failed(Exception):
    """A call that could not be measured."""


def measure(name: str, trials: int, scale: float, seed: int) -> tuple[float, float, list[float]]:
    """Duration of one call, longest gap, and latencies, all in s."""
    setup, call = CASES[name]
    draw = random.Random(seed)
    arguments = json.dumps([COMMON + setup, call, scale, REPEATS, LONGEST])
    latencies: list[float] = []
    with subprocess.Popen(
        [sys.executable, "-P", "-c", CHILD, arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=dict(os.environ)
    ) as child:
        assert child.stdin is not None and child.stdout is not None
        endless = threading.Timer(ENDLESS, child.send_signal, [signal.SIGINT])
        endless.start()
        line = child.stdout.readline()
        endless.cancel()
        if not line:
            raise Failed("the process ended")
        took, gap = json.loads(line)
        for _ in range(trials):
            guard = threading.Timer(LOST, child.kill)
            guard.start()
            child.stdin.write("\n")
            child.stdin.flush()
            if child.stdout.readline() != "go\n":
                raise Failed(f"no answer within {LOST} s, or an error")
            time.sleep(draw.uniform(0.0, min(took, 2.0)))
            sent = time.perf_counter()
            child.send_signal(signal.SIGINT)
            answered = child.stdout.readline()
            guard.cancel()
            if not answered.strip():
                raise Failed(f"no answer within {LOST} s")
            latencies.append(float(answered) - sent)
        child.stdin.close()
    return took, gap, sorted(latencies)


def percentile(values: list[float], share: float) -> float:
    """The smallest value that at least this share of the values does not exceed."""
    return values[min(len(values) - 1, max(0, -int(-share * len(values) // 1) - 1))]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=100, help="signals per call")
    parser.add_argument("--scale", type=float, default=1.0, help="sizes of the calls, times the ones in their names")
    parser.add_argument("--only", default="", help="calls whose names contain this")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--readme", action="store_true", help="put the table into benches/README.md")
    options = parser.parse_args()
    machine, info = timing.machine(), al.build_info()
    busy = timing.busy()
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores; armlet {info['version']}, {info['profile']} build. "
        f"{options.trials} signals per call, sizes times {options.scale:g}; other programs used {busy:.0%} of the machine at the start.",
        "",
        ROW.format("call", "one call", "Ctrl-C 50", "Ctrl-C 99", "gap", ""),
        "|---|---:|---:|---:|---:|---|",
    ]
    print("\n".join(lines), flush=True)
    missed = 0
    for name in CASES:
        if options.only not in name:
            continue
        try:
            took, gap, latencies = measure(name, options.trials, options.scale, options.seed)
        except Failed as error:
            lines.append(ROW.format(name, "-", "-", "-", "-", str(error)))
            missed += 1
        else:
            late = percentile(latencies, 0.99)
            met = late <= LATENCY and gap <= GAP
            missed += not met
            seconds = f"{took:.2f} s" if took < ENDLESS else "no end"
            figures = [f"{1e3 * x:.0f} ms" for x in (percentile(latencies, 0.5), late, gap)]
            lines.append(ROW.format(name, seconds, *figures, "met" if met else "**missed**"))
        print(lines[-1], flush=True)
    lines += ["", f"{missed} missed."]
    print("\n".join(lines[-2:]))
    if options.readme:
        write_figures("latency", "\n".join(lines))
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
