"""C that CasADi generates for an expression, compiled by g++ for one row at a time or for lanes of rows, and called through ctypes.

`compiling.py` defines lanes, with their sine and cosine. The C for one row uses the sine and cosine of the C library.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import casadi as ca
import numpy as np
from compiling import INLINE, LANES, compiled
from numpy.typing import NDArray

Array = NDArray[np.float64]
POOL = ThreadPoolExecutor(2)

# CasADi's C code for fmin, fmax and `if_else`, and the functions that replace it, because vectors of lanes have no `?:`.
CHOICES = (
    (r"\ncasadi_real casadi_fm", "\nINLINE casadi_real casadi_fm"),
    (r"return x>y \? x : y;", "return larger(x, y);"),
    (r"return x<y \? x : y;", "return smaller(x, y);"),
    (r"\((\w+)\?(\w+):0\)", r"take(\1, \2)"),
)

SCALARS = """typedef double Real;
INLINE Real take(Real where, Real a) { return where ? a : 0; }
INLINE Real larger(Real a, Real b) { return a > b ? a : b; }
INLINE Real smaller(Real a, Real b) { return a < b ? a : b; }
"""

LOOP = """
static __attribute__((noinline)) void rate(const Real* x, const Real* u, Real* d) {
  const Real* arguments[2] = {x, u}; Real* results[1] = {d}; casadi_int nothing[1];
  f(arguments, results, nothing, 0, 0);
}
// RK4 with the law in every stage: `groups` states in lanes, the motion tabulated at the half steps.
extern "C" void loop(double* states, const double* table, long groups, long steps, double h) {
  for (long g = 0; g < groups; g++) {
    Real* x = (Real*)states + g * NX; Real k[NX], y[NX], s[NX], u[3][NU];
    for (long t = 0; t < steps; t++) {
      for (int j = 0; j < 3; j++) for (int i = 0; i < NU; i++) u[j][i] = Real(table[(2 * t + j) * NU + i]);
      rate(x, u[0], k); for (int i = 0; i < NX; i++) { s[i] = k[i]; y[i] = x[i] + Real(0.5 * h) * k[i]; }
      rate(y, u[1], k); for (int i = 0; i < NX; i++) { s[i] = s[i] + Real(2.0) * k[i]; y[i] = x[i] + Real(0.5 * h) * k[i]; }
      rate(y, u[1], k); for (int i = 0; i < NX; i++) { s[i] = s[i] + Real(2.0) * k[i]; y[i] = x[i] + Real(h) * k[i]; }
      rate(y, u[2], k); for (int i = 0; i < NX; i++) x[i] = x[i] + Real(h / 6.0) * (s[i] + k[i]);
    }
  }
}
"""

ROWS = """
static __attribute__((noinline)) void one(const Real* x, Real* y) {
  const Real* arguments[1] = {x}; Real* results[1] = {y}; casadi_int nothing[1];
  f(arguments, results, nothing, 0, 0);
}
// Rows of several arrays of `N` columns, side by side in memory as the caller has them; `OUT` numbers per row go out.
extern "C" void rows(const double* const* in, double* out, long count) {
  for (long first = 0; first < count; first += WIDTH) {
    Real x[PARTS * N], y[OUT];
    for (int part = 0; part < PARTS; part++) for (int lane = 0; lane < WIDTH; lane++) for (int i = 0; i < N; i++)
      ((double*)&x[part * N + i])[lane] = in[part][(first + lane) * N + i];
    one(x, y);
    for (int lane = 0; lane < WIDTH; lane++) for (int i = 0; i < OUT; i++) out[(first + lane) * OUT + i] = ((double*)&y[i])[lane];
  }
}
// The same with the rows arranged in lanes before and after the call, which saves the copies.
extern "C" void arranged(const double* in, double* out, long count) {
  for (long g = 0; g < count / WIDTH; g++) one((const Real*)in + g * PARTS * N, (Real*)out + g * OUT);
}
"""


def source(function: Any, width: int, rest: str, sizes: dict[str, int]) -> str:
    """The C of a CasADi function `f` and of the loop that calls it. `Real` is a double or a vector of `width` doubles."""
    generator = ca.CodeGenerator("generated.c", {"with_header": False, "cpp": True})
    generator.add(function)
    code = generator.dump().replace('extern "C"', "").replace("#define casadi_real double", "#define casadi_real Real")
    for pattern, other in CHOICES:
        code = re.sub(pattern, other, code)
    start = "#include <math.h>\n" + (LANES if width > 1 else SCALARS)
    return "".join(f"#define {name} {value}\n" for name, value in {"WIDTH": width, "INLINE": INLINE, **sizes}.items()) + start + code + rest


def aligned(shape: tuple[int, ...]) -> Array:
    """Zeros of this shape at an address that is a multiple of 64 bytes."""
    count = int(np.prod(shape))
    space = np.zeros(count + 8)
    first = (-space.ctypes.data // 8) % 8
    return space[first : first + count].reshape(shape)


def at(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def in_lanes(rows: Array, width: int) -> Array:
    """Rearrange `(rows, columns)` as `(groups, columns, lanes)`."""
    groups = aligned((len(rows) // width, rows.shape[1], width))
    groups[:] = rows.reshape(-1, width, rows.shape[1]).transpose(0, 2, 1)
    return groups


def from_lanes(groups: Array) -> Array:
    return groups.transpose(0, 2, 1).reshape(-1, groups.shape[1])


class Loop:
    """RK4 for x' = f(x, u), with u from a table at the half steps."""

    def __init__(self, x: Any, u: Any, rate: Any, width: int) -> None:
        function = ca.Function("f", [x, u], [ca.cse(ca.densify(rate))])
        self.width, self.operations = width, function.n_instructions()
        self._loop = compiled(source(function, width, LOOP, {"NX": x.numel(), "NU": u.numel()})).loop
        self._loop.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long, ctypes.c_long, ctypes.c_double]

    def ready(self, starts: Array, table: Array, h: float) -> Callable[..., Array]:
        """A function of the number of steps and threads. It runs from `starts` `(runs, columns)` and returns the final states in lanes."""
        before = in_lanes(starts, self.width)
        states, kept = aligned(before.shape), np.ascontiguousarray(table)
        state, motion, groups = at(states), at(kept), len(states)
        halves = [(at(states), groups // 2), (at(states[groups // 2 :]), groups - groups // 2)]

        def run(steps: int, threads: int = 1, _kept: Array = kept) -> Array:
            states[:] = before
            if threads == 1:
                self._loop(state, motion, groups, steps, h)
            else:
                list(POOL.map(lambda half: self._loop(half[0], motion, half[1], steps, h), halves))
            return states

        return run


class Rows:
    """y = f(x_1, x_2, ..) for each row of arrays `(rows, n)`."""

    def __init__(self, parts: list[Any], result: Any, width: int) -> None:
        x = ca.vertcat(*parts)
        function = ca.Function("f", [x], [ca.cse(ca.densify(result.T))])
        self.width, self.operations, self.size = width, function.n_instructions(), result.numel()
        sizes = {"PARTS": len(parts), "N": parts[0].numel(), "OUT": self.size}
        self._library = compiled(source(function, width, ROWS, sizes))
        for entry in (self._library.rows, self._library.arranged):
            entry.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long]

    def rows(self, parts: list[Array]) -> Callable[[], Array]:
        """A function that computes every row and returns the results row by row."""
        kept, out = [np.ascontiguousarray(part) for part in parts], aligned((len(parts[0]), self.size))
        pointers = (ctypes.c_void_p * len(kept))(*(part.ctypes.data for part in kept))
        return self._ready(self._library.rows, ctypes.cast(pointers, ctypes.c_void_p), out, len(out), (kept, pointers))

    def arranged(self, parts: list[Array]) -> Callable[[], Array]:
        """A function that computes every row from arguments already arranged in lanes, and returns the results in lanes."""
        groups = in_lanes(np.hstack(parts), self.width)
        out = aligned((len(groups), self.size, self.width))
        return self._ready(self._library.arranged, at(groups), out, len(parts[0]), groups)

    @staticmethod
    def _ready(entry: Any, given: ctypes.c_void_p, out: Array, count: int, kept: Any) -> Callable[[], Array]:
        to = at(out)

        def run(_kept: Any = kept) -> Array:
            entry(given, to, count)
            return out

        return run
