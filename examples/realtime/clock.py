"""A clock for loops in Python, and two measures against delays: memory locked in RAM, and a real-time priority."""

import ctypes
import os
import time


def reserve() -> dict[str, bool]:
    """Lock the memory and set real-time priority, if the system permits it. Return which of both succeeded."""
    libc = ctypes.CDLL(None, use_errno=True)
    locked = libc.mlockall(3) == 0  # MCL_CURRENT | MCL_FUTURE
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(80))
    except PermissionError:
        return {"memory locked": locked, "SCHED_FIFO": False}
    return {"memory locked": locked, "SCHED_FIFO": True}


def wait_until(deadline: float) -> float:
    """Sleep until `time.perf_counter()` reaches `deadline`; return the delay of the wake-up, s."""
    rest = deadline - time.perf_counter()
    if rest > 0.0:
        time.sleep(rest)
    return time.perf_counter() - deadline
