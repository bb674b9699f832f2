"""A clock for loops in Python, and what the system allows: pages that stay in memory, and a priority above other programs."""

import ctypes
import os
import time


def reserve() -> dict[str, bool]:
    """Lock the memory and take the priority of real-time programs, where that is permitted; whether it was."""
    libc = ctypes.CDLL(None, use_errno=True)
    locked = libc.mlockall(3) == 0  # MCL_CURRENT | MCL_FUTURE
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(80))
    except PermissionError:
        return {"memory locked": locked, "SCHED_FIFO": False}
    return {"memory locked": locked, "SCHED_FIFO": True}


def wait_until(deadline: float) -> float:
    """Sleep until `time.perf_counter()` is `deadline`; how late it became, s."""
    rest = deadline - time.perf_counter()
    if rest > 0.0:
        time.sleep(rest)
    return time.perf_counter() - deadline
