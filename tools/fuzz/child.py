"""Run calls in a separate process: `child.py SEED FIRST LIMIT_S MEMORY_BYTES`. It prints one line per event.

It prints `<i>` before call number i, and `! <i> <kind> <what>` if this call has a fault. If the process dies, the last printed call has
the fault.
"""

from __future__ import annotations

import os
import resource
import sys
import time
import traceback
import warnings
from itertools import count
from typing import Any

import numpy as np
from calls import FIGURE, IMPORTS, Call, call
from signatures import targets

import armlet as al

ALLOWED = (al.ArmletError, TypeError, MemoryError, OSError)
#: Exceptions that Python's protocols and the documentation allow: IndexError of an index beyond the end, ImportError of a missing package.
ALLOWED_BY_PROTOCOL = {"__getitem__": (IndexError,), "": (ImportError,)}
MADE: dict[str, Any] = {}
#: Additional seconds that a call may take per number of its result (`EACH`) and of its arguments (`READ`). A result of 10^8 rows takes
#: long.
EACH, READ = 1e-7, 3e-8
#: Seconds allowed for a search whose duration depends on options of the caller.
LONG = {"exciting_motion": 20.0}
# Objects with a state are constructed again for every call.
STATEFUL = ("al.Simulator", "al.PrioritySolver")


def fingerprint(value: Any, depth: int = 0) -> Any:
    """A value that can be compared before and after a call; None if the argument cannot be compared."""
    if isinstance(value, np.ma.MaskedArray):
        return None
    if isinstance(value, np.ndarray) and value.nbytes < 1_000_000 and not value.dtype.hasobject:
        return value.shape, value.dtype.str, value.flags.writeable, value.tobytes()
    if isinstance(value, list | tuple) and depth < 6 and len(value) < 1000:
        return type(value), [fingerprint(item, depth + 1) for item in value]
    if isinstance(value, dict) and depth < 6:
        return [(repr(key), fingerprint(item, depth + 1)) for key, item in value.items()]
    return repr(value) if isinstance(value, str | bytes | bytearray | int | float | complex) else None


def fault_of(error: BaseException, made: Call) -> tuple[str, str] | None:
    """The kind and the place of the fault that an exception reports; None if the exception is allowed."""
    name = made.target.rpartition(".")[2]
    allowed = ALLOWED + ALLOWED_BY_PROTOCOL.get(name, ()) + ALLOWED_BY_PROTOCOL[""]
    panic = isinstance(error, al.InternalError) or type(error).__name__ == "PanicException"
    if not panic and isinstance(error, allowed) and not isinstance(error, ModuleNotFoundError):
        return None
    called = traceback.extract_tb(error.__traceback__)[-1]
    # A function among the arguments raised the exception. It must reach the caller.
    if not panic and called.filename == "<string>" and called.name != "<module>":
        return None
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "armlet" in f.filename and "fuzz" not in f.filename]
    place = f" at {os.path.basename(frames[-1].filename)}:{frames[-1].name}" if frames else ""
    return "panic" if panic else "foreign exception", f"{type(error).__name__}{place}: {' '.join(str(error).split())[:160]}"


def numbers_of(value: Any, depth: int = 0) -> int:
    """The number of entries of all arrays in a result or an argument."""
    if isinstance(value, tuple | list) and depth < 6:
        return sum(numbers_of(item, depth + 1) for item in value[:100])
    return value.size if isinstance(value, np.ndarray) else 0


def run(made: Call, limit: float) -> tuple[str, str] | None:
    """The kind and the description of the call's fault, or None."""
    space: dict[str, Any] = {}
    exec(IMPORTS + FIGURE, space)
    try:
        if made.owner:
            space["owner"] = MADE[made.owner] if made.owner in MADE else eval(made.owner, space)
            if not made.owner.startswith(STATEFUL) and len(MADE) < 2000:
                MADE[made.owner] = space["owner"]
        for variable, source, _ in made.arguments:
            space[variable] = eval(source, space)
    except BaseException as error:
        return fault_of(error, made)
    before = {variable: fingerprint(space[variable]) for variable, _, stays in made.arguments if stays}
    wall, work = time.perf_counter(), time.process_time()
    fault = None
    try:
        exec(made.body, space)
        if not isinstance(space["result"], np.ndarray | list | tuple | dict):
            repr(space["result"])
    except BaseException as error:
        fault = fault_of(error, made)
    # The smaller of wall time and processor time excludes most other work on the machine.
    spent = min(time.perf_counter() - wall, time.process_time() - work)
    read = READ * sum(numbers_of(space[variable]) for variable, _, _ in made.arguments)
    if fault is None and spent > max(limit, LONG.get(made.target, 0.0)) + read + EACH * numbers_of(space.get("result")):
        fault = "slow", f"{spent:.1f} s"
    if fault is None:
        changed = [variable for variable, held in before.items() if fingerprint(space[variable]) != held]
        fault = ("changed input", ", ".join(changed)) if changed else None
    return fault


def main() -> None:
    seed, first, limit, memory = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
    last = int(sys.argv[5]) if len(sys.argv) > 5 else None
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 28, 1 << 28))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    report = os.fdopen(os.dup(1), "w", buffering=1)
    # Output of the call must not mix with the lines of this program.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    known = targets()
    for number in count(first):
        if last is not None and number > last:
            break
        made = call(known, seed, number)
        report.write(f"{number}\n")
        fault = run(made, limit)
        if fault:
            report.write(f"! {number} {fault[0]} | {fault[1]}\n".encode("ascii", "backslashreplace").decode())
    report.write("end\n")


if __name__ == "__main__":
    main()
