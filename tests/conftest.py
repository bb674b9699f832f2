"""What tests of several folders share."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable

import pytest

# Whoever started the tests may have Ctrl-C ignored (`nohup`, a job in the background), and programs that tests start would inherit that.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def interrupted() -> Callable[[str], tuple[list[str], float]]:
    """A function that runs a program, sends it Ctrl-C 0.4 s after its line "ready", and returns the words
    of its next line and the seconds until then.

    A program that does not answer is killed after 40 s: it then has no words.
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
