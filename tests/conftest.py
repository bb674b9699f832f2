"""Fixtures and settings for tests in several folders."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable

import pytest

# If the parent process ignores Ctrl-C (`nohup`, a background job), programs that tests start would inherit this. So it is reset.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def interrupted() -> Callable[[str], tuple[list[str], float]]:
    """Return a function that runs a program and sends it Ctrl-C 0.4 s after its line "ready".

    The function returns the words of the program's next line, and the seconds until that line. A program that does not answer is killed
    after 40 s and has no words.
    """

    def run(code: str) -> tuple[list[str], float]:
        with subprocess.Popen([sys.executable, "-P", "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, text=True) as process:
            guard = threading.Timer(40.0, process.kill)
            guard.start()
            try:
                assert process.stdout is not None
                assert process.stdout.readline() == "ready\n"
                time.sleep(0.4)
                sent = time.perf_counter()
                process.send_signal(signal.SIGINT)
                return process.stdout.readline().split(), time.perf_counter() - sent
            finally:
                guard.cancel()
                process.kill()

    return run
