"""Hand-written C kernels, which show how fast the loops can run. They are compiled if ARMLET_LIMITS names the directory of their sources.

The kernels are written for AVX-512. On other processors `eight_lanes.h` replaces each register by two registers of AVX2.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import timing
from numpy.typing import NDArray


class Kernels:
    """`native/<source>` in the directory ARMLET_LIMITS, compiled for this processor into a temporary directory.

    Raises `ImportError`, which names the missing part: the directory, the source or the compiler.
    """

    FLAGS = "-O3 -march=native -std=c++17 -fno-math-errno -ffp-contract=fast -mprefer-vector-width=512 -fno-tree-slp-vectorize -w".split()

    def __init__(self, source: str, *libraries: str) -> None:
        where = os.environ.get("ARMLET_LIMITS")
        if not where:
            raise ImportError("ARMLET_LIMITS names no directory")
        path, compiler = Path(where) / "native" / source, shutil.which("g++")
        if not path.exists() or compiler is None:
            raise ImportError(f"no {path.name}" if compiler else "no g++")
        self._kept = tempfile.TemporaryDirectory()
        library = Path(self._kept.name) / "limits.so"
        source, flags = path.read_text(), self.FLAGS
        if timing.machine()["simd"] != "AVX-512":
            source = re.sub(r"typedef double v8 [^;]*;", "", source)
            flags = [*flags, "-include", str(Path(__file__).parent / "eight_lanes.h")]
        command = [compiler, *flags, "-shared", "-fPIC", "-x", "c++", "-", "-o", str(library), *libraries]
        subprocess.run(command, input=source, text=True, check=True)
        self._c = ctypes.CDLL(str(library))

    @staticmethod
    def _at(array: NDArray[np.float64]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)
