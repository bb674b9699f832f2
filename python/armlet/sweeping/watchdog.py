"""Worker processes end with the process that started them."""

from __future__ import annotations

import os
import threading
from functools import cache

__all__ = ["leave_with"]


@cache
def leave_with(client: int) -> None:
    """End this worker when its parent process `client` ends. Otherwise the workers of a killed client would wait without end."""
    from multiprocessing import parent_process  # takes a while, and only workers need it

    parent = parent_process()
    if parent is None or parent.pid != client:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="armlet-orphan", daemon=True).start()
