"""A watchdog that ends a worker process when the process that started it has ended."""

from __future__ import annotations

import os
import threading
from functools import cache

__all__ = ["leave_with"]


@cache
def leave_with(client: int) -> None:
    """End this worker process when its parent process with the id `client` ends. Otherwise the workers of a killed parent never end."""
    from multiprocessing import parent_process  # imported here, because the import is slow and only workers use it

    parent = parent_process()
    if parent is None or parent.pid != client:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="armlet-orphan", daemon=True).start()
