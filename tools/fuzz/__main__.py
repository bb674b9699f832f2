"""`make fuzz SECONDS=60 SEED=1`: random calls of the whole public API in child processes, with plausible and odd arguments.

A call has a fault in six cases:

- it panics (InternalError);
- it ends the process;
- it gives no answer within 30 s (a debug build: 80 s);
- it takes over 2 s of processor time (a debug build: 20 s), or more for large results, large arguments and searches;
- it raises an error other than ArmletError, TypeError, MemoryError, OSError, ImportError of a missing optional package, or IndexError of
  an index beyond the end;
- it changes an argument.

Each fault is printed once, with a snippet that reproduces it. The exit code is 1 if there is a fault.

    python tools/fuzz --seconds 60 --seed 1            search
    python tools/fuzz --seed 1 --call 1234             print call number 1234 and run it
"""

from __future__ import annotations

import argparse
import os
import re
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from calls import call
from signatures import targets

import armlet as al

HERE = Path(__file__).resolve().parent
LIMIT = 2.0
DEBUG_BUILD = al.build_info()["profile"] == "debug"
MEMORY = 4 << 30
#: Number of calls per process. It limits the effect of a memory leak or a broken state.
CALLS = 3000


class Child:
    """One child process that runs calls, beginning with number `first`."""

    def __init__(self, seed: int, first: int, limit: float, folder: str, last: int | None = None) -> None:
        command = [sys.executable, str(HERE / "child.py"), str(seed), str(first), str(limit), str(MEMORY)]
        environment = os.environ | {"MPLBACKEND": "Agg", "PYTHONFAULTHANDLER": "1"}
        # Unoptimised code needs a larger stack.
        environment |= {"RUST_MIN_STACK": "268435456"} if DEBUG_BUILD else {}
        self.errors = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(
            command + ([] if last is None else [str(last)]),
            stdout=subprocess.PIPE, stderr=self.errors, stdin=subprocess.DEVNULL, cwd=folder, env=environment, start_new_session=True,
        )  # fmt: skip
        assert self.process.stdout is not None
        os.set_blocking(self.process.stdout.fileno(), False)
        self.selector = selectors.DefaultSelector()
        self.selector.register(self.process.stdout, selectors.EVENT_READ)
        self.partial = b""

    def lines(self, timeout: float) -> list[str] | None:
        """New lines of the child's output; None after the process has ended and all lines are read."""
        assert self.process.stdout is not None
        if self.selector.select(timeout):
            data = self.process.stdout.read()
            if not data:
                return None
            *whole, self.partial = (self.partial + data).split(b"\n")
            return [line.decode("ascii", "replace") for line in whole]
        return []

    def end(self) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.selector.close()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self.errors.close()

    def last_words(self) -> str:
        self.errors.seek(0)
        return " ".join(self.errors.read().split())[:300]


class Search:
    """Number of calls, and the faults, counted by kind and place."""

    def __init__(self, seed: int, limit: float) -> None:
        self.seed, self.limit = seed, limit
        self.known = targets()
        self.calls = 0
        self.faults: dict[tuple[str, str, str], int] = {}
        self.counts: Counter[tuple[str, str, str]] = Counter()

    def fault(self, number: int, kind: str, what: str) -> None:
        made = call(self.known, self.seed, number)
        # Two messages that differ only in numbers or quoted words are the same fault.
        key = (made.target, kind, re.sub(r"'[^']*'|[-+]?\d[\d.e+-]*", "#", what)[:60])
        self.counts[key] += 1
        if key not in self.faults:
            self.faults[key] = number
            print(f"\n== {kind} in {made.target}, call {number} of seed {self.seed}: {what}\n{made}", flush=True)

    def children(self, first: int, until: float, last: int | None = None) -> int:
        """Run one child until the time `until`, for `CALLS` calls, or until it ends. Return the number of the next call."""
        number, since = first, time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            child = Child(self.seed, first, self.limit, folder, last)
            try:
                while True:
                    lines = child.lines(0.25)
                    if lines is None:
                        break
                    for line in lines:
                        if line.startswith("!"):
                            _, which, rest = line.split(" ", 2)
                            kind, what = rest.split(" | ", 1)
                            self.fault(int(which), kind, what)
                        elif line == "end":
                            return number + 1
                        else:
                            number, since = int(line), time.monotonic()
                            self.calls += 1
                    if time.monotonic() - since > max(30.0, 4 * self.limit):
                        self.fault(number, "hang", f"no answer within {time.monotonic() - since:.0f} s")
                        return number + 1
                    if time.monotonic() > until or number - first >= CALLS:
                        return number + 1
                code = child.process.wait()
                died = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
                self.fault(number, died, child.last_words())
                return number + 1
            finally:
                child.end()

    def report(self) -> None:
        print(f"\nfuzz: seed {self.seed}: {self.calls} calls of {len(self.known)} functions, methods and properties", end="")
        print(f"; {len(self.faults)} faults, {sum(self.counts.values())} times" if self.faults else "; no fault")
        for (target, kind, what), times in self.counts.most_common():
            print(f"{times:6} {target}: {kind}: {what} (call {self.faults[target, kind, what]})")


def main() -> int:
    parser = argparse.ArgumentParser(prog="fuzz", description="random calls of the public API of armlet")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--call", type=int, help="this call alone, printed")
    parser.add_argument("--calls", type=int, help="so many calls, however long they take")
    parser.add_argument("--first", type=int, default=0, help="number of the first call")
    given = parser.parse_args()
    limit = LIMIT * (10.0 if DEBUG_BUILD else 1.0)
    search = Search(given.seed, limit)
    if given.call is not None:
        print(call(search.known, given.seed, given.call), flush=True)
        search.children(given.call, time.monotonic() + 600.0, given.call)
        search.report()
        return 1 if search.faults else 0
    begun = shown = time.monotonic()
    last = None if given.calls is None else given.first + given.calls - 1
    until = begun + (given.seconds if given.calls is None else 3600.0)
    number = given.first
    while time.monotonic() < until and (last is None or number <= last):
        number = search.children(number, until, last)
        if time.monotonic() - shown > 60.0:
            shown = time.monotonic()
            print(f"-- {search.calls} calls, {len(search.faults)} faults, {shown - begun:.0f} s", flush=True)
    search.report()
    return 1 if search.faults else 0


if __name__ == "__main__":
    sys.exit(main())
