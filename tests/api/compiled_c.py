"""Compile and call the C of `armlet.export_c` with every installed C compiler, with all warnings as errors."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Installed C compilers. Without one the tests fail, because the build of armlet also requires a C compiler.
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)] or ["cc"]
FLAGS = ["-Wall", "-Wextra", "-Werror", "-std=c99", "-ffp-contract=off", "-O1"]


def build(files: list[Path], compiler: str, *more: str) -> Path:
    """Compile the source file to a shared library and return its path."""
    header, source, _ = files
    library = source.with_name(f"{source.stem}_{compiler}{len(more)}.so")
    command = [compiler, *FLAGS, *more, "-fPIC", "-shared", str(source), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr}"
    assert header.exists()
    return library


def pointer(x: Array) -> Any:
    return x.ctypes.data_as(ctypes.c_void_p)


class Functions:
    """The compiled functions of an arm."""

    def __init__(self, files: list[Path], compiler: str, *more: str, prefix: str = "arm") -> None:
        self.library = ctypes.CDLL(str(build(files, compiler, *more)))
        self.prefix = prefix
        self.sizes = {name: int(size) for name, size in re.findall(rf"int {prefix}_(\w+)\(.*double out\[(\d+)\]\);", files[0].read_text())}

    def status(self, name: str, *inputs: Any) -> tuple[int, Array]:
        out = np.empty(self.sizes[name])
        given = [np.ascontiguousarray(x, dtype=np.float64) for x in inputs]
        function = getattr(self.library, f"{self.prefix}_{name}")
        return function(*[pointer(x) for x in given], pointer(out)), out

    def __call__(self, name: str, *inputs: Any) -> Array:
        status, out = self.status(name, *inputs)
        assert status == 0
        return out


class Controller:
    """A compiled law. It stores the law's state and computes steps."""

    def __init__(self, files: list[Path], compiler: str, *more: str, prefix: str = "law") -> None:
        self.library = ctypes.CDLL(str(build(files, compiler, *more)))
        text = files[0].read_text()
        self.n, self.p = (int(re.findall(rf"#define {prefix.upper()}_{name} (\d+)", text)[0]) for name in ("N", "STATES"))
        self.step = getattr(self.library, f"{prefix}_step")
        self.begin = getattr(self.library, f"{prefix}_init")
        # The C state has tau and, for a law with a state, also the state, its rate, t and the flag `started`.
        self.memory = np.full(self.n + (2 * self.p + 2 if self.p else 0), np.nan)
        self.init()

    def init(self) -> None:
        self.begin(pointer(self.memory))

    def resume(self, t: float, state: Array) -> None:
        """Store the state, a rate of zero and the time `t`, as an earlier call would. So the law does not restart its filters."""
        self.memory[self.n : self.n + self.p] = state
        self.memory[self.n + self.p : self.n + 2 * self.p] = 0.0
        self.memory[self.n + 2 * self.p] = t
        self.memory[self.n + 2 * self.p + 1 :].view(np.int32)[0] = 1

    @property
    def state(self) -> Array:
        return self.memory[self.n : self.n + self.p].copy()

    def status(self, t: float, *measured: Any) -> tuple[int, Array]:
        tau = np.empty(self.n)
        given = [np.ascontiguousarray(x, dtype=np.float64) for x in measured]
        return self.step(pointer(self.memory), ctypes.c_double(t), *[pointer(x) for x in given], pointer(tau)), tau

    def __call__(self, t: float, *measured: Any) -> Array:
        status, tau = self.status(t, *measured)
        assert status == 0, status
        return tau


class Observer:
    """A compiled momentum observer. It stores the observer's state and processes samples."""

    def __init__(self, files: list[Path], compiler: str, *more: str) -> None:
        self.library = ctypes.CDLL(str(build(files, compiler, *more)))
        self.n = int(re.findall(r"#define OBSERVER_N (\d+)", files[0].read_text())[0])
        # The C state has residual, momentum, drift and the flag `started`.
        self.memory = np.full(3 * self.n + 1, np.nan)
        self.library.observer_init(pointer(self.memory))

    def status(self, q: Any, v: Any, tau: Any, dt: float) -> tuple[int, Array]:
        residual = np.empty(self.n)
        given = [pointer(np.ascontiguousarray(x, dtype=np.float64)) for x in (q, v, tau)]
        status = self.library.observer_update(pointer(self.memory), *given, ctypes.c_double(dt), pointer(residual))
        return status, residual

    def __call__(self, q: Any, v: Any, tau: Any, dt: float) -> Array:
        status, residual = self.status(q, v, tau, dt)
        assert status == 0, status
        return residual

    def contact(self) -> int:
        return int(self.library.observer_contact(pointer(self.memory)))
