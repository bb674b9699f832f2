"""The symmetric bang-bang profile in hand-written C, vectorised over problems. `bench_mintime.py` compares armlet's time with it.

    a_max = min(tau_max - max_1 G sin, min_2 G sin - tau_min),  a_min = max(0, tau_min - min_1 G sin, max_2 G sin - tau_max)
    T in [2 sqrt(I D / a_max), 2 sqrt(I D / a_min)]

`docs/minimum_time.md` derives the formulas. The C does not check arguments. For a motion of zero length it does not check whether the
torque can hold the pose.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from compiling import INLINE, LANES, WIDEST, compiled
from numpy.typing import NDArray

Array = NDArray[np.float64]

SOURCE = """
INLINE Vector root(Vector x) { for (int l = 0; l < WIDTH; l++) x[l] = sqrt(x[l]); return x; }
INLINE Vector more(Vector a, Vector b) { return a < b ? b : a; }
INLINE Vector less(Vector a, Vector b) { return a < b ? a : b; }
// The largest sine on [x, y], with sines p and q at the ends; first is the angle of a crest.
INLINE Vector crest(Vector x, Vector y, Vector p, Vector q, double first) {
  const double whole = 6755399441055744.0, turn = 6.283185307179586;
  Vector turns = (x - first) / turn, near = (turns + whole) - whole, up = near < turns ? near + 1.0 : near;
  Vector one = turns - turns + 1.0;
  return first + turn * up <= y ? one : more(p, q);
}
extern "C" void all(const double* const* in, double* const* out, unsigned char* const* flags, long count) {
  const double quarter = 1.5707963267948966;
  for (long i = 0; i < count; i += WIDTH) {
    Vector c[6];
    for (int k = 0; k < 6; k++) __builtin_memcpy(&c[k], in[k] + i, sizeof(Vector));
    Vector way = c[1] - c[0], inertia = c[2], g = c[3];
    Bits back = way < 0.0;
    Vector high = back ? -c[5] : c[4], low = back ? -c[4] : c[5], x = back ? -c[0] : c[0], y = back ? -c[1] : c[1];
    Vector m = 0.5 * x + 0.5 * y, s[3] = {wave(x, 0), wave(m, 0), wave(y, 0)};
    Vector most1 = crest(x, m, s[0], s[1], quarter), most2 = crest(m, y, s[1], s[2], quarter);
    Vector least1 = -crest(x, m, -s[0], -s[1], -quarter), least2 = -crest(m, y, -s[1], -s[2], -quarter);
    Vector a = g * least1, b = g * most1, d = g * least2, e = g * most2;
    Vector most = less(high - more(a, b), less(d, e) - low), least = more(more(low - less(a, b), more(d, e) - high), g - g);
    Vector slack = 1e-12 * more(c[4], -c[5]), none = (g - g) / (g - g), work = inertia * (y - x);
    Bits feasible = (most > 0.0) & (most >= least - slack);
    Vector first = 2.0 * root(work / most), last = more(2.0 * root(work / least), first);
    Vector answers[4] = {feasible ? first : none, feasible ? last : none, least, most};
    Vector from = g * s[0], to = g * s[2];
    Bits held[3] = {feasible, (from >= low - slack) & (from <= high + slack), (to >= low - slack) & (to <= high + slack)};
    for (int k = 0; k < 4; k++) __builtin_memcpy(out[k] + i, &answers[k], sizeof(Vector));
    for (int k = 0; k < 3; k++) for (int l = 0; l < WIDTH; l++) flags[k][i + l] = held[k][l] & 1;
  }
}
"""


def in_c(columns: list[Array]) -> Callable[[], list[Array]]:
    """A function that solves all problems and returns the times and accelerations.

    The columns are theta0, thetaf, inertia, gravity_moment, tau_max, tau_min.
    """
    count = len(columns[0])
    assert count % WIDEST == 0
    library = compiled(f"#include <math.h>\n#define WIDTH {WIDEST}\n#define INLINE {INLINE}\n{LANES}{SOURCE}")

    def run() -> list[Array]:
        # Each call allocates new arrays, as armlet does.
        out, flags = [np.empty(count) for _ in range(4)], [np.empty(count, dtype=bool) for _ in range(3)]
        library.all(*(pointers(arrays) for arrays in (columns, out, flags)), ctypes.c_long(count))
        return out

    return run


def pointers(arrays: list[Any]) -> Any:
    return (ctypes.c_void_p * len(arrays))(*(array.ctypes.data for array in arrays))
