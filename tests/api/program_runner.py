"""Programs that run in children of one process. This process has imported armlet and matplotlib, so that a program needs no time for that.

A system without `fork` starts a new interpreter for each program.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

#: Reads a request in each line of stdin. A child runs the program like `python -W error -c`; the process prints the child's exit code.
SERVER = """
import json, os, signal, sys
import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot
import armlet

program = None
for line in sys.stdin:
    folder, code = json.loads(line)
    child = os.fork()
    if child == 0:
        program = code
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
if program is not None:
    signal.alarm(120)
    os.chdir(folder)
    for name, descriptor in (("stdout", 1), ("stderr", 2)):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    exec(program, {"__name__": "__main__"})
"""


class ProgramRunner:
    """A context manager. Calls run a program without a display, in a new folder, with warnings as errors."""

    def __init__(self) -> None:
        self.command = [sys.executable, "-P", "-W", "error", "-c"]
        self.server: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        if hasattr(os, "fork"):
            self.server = subprocess.Popen([*self.command, SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self.server is not None:
            self.server.communicate()

    def __call__(self, code: str, folder: Path) -> subprocess.CompletedProcess[str]:
        if self.server is None:
            return subprocess.run([*self.command, code], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
        assert self.server.stdin is not None and self.server.stdout is not None
        self.server.stdin.write(json.dumps([str(folder), code]) + "\n")
        self.server.stdin.flush()
        status = int(self.server.stdout.readline())
        stdout, stderr = ((folder / name).read_text(encoding="utf-8") for name in ("stdout", "stderr"))
        return subprocess.CompletedProcess([], status, stdout, stderr)
