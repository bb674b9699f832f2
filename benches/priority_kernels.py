"""Tasks in priority in hand-written C, for one stack or for lanes of stacks, and in numba. `bench_priority.py` compares armlet with them.

Two levels of two rows, four joints, by one rotation per level (Golub and Van Loan, Matrix Computations, 8.5). `A` is the projected Jacobian
of the level and `r` its residual. The rotation `R` makes the rows of `G` orthogonal, with the lengths `s`. `J_k` are the Jacobians of the
lower levels, and `h(s) = 1 / max(s^2, eps^2)`:

    G = R A,  v += G' diag(h) R r,  J_k <- J_k - J_k G' diag(h) G

Three levels of 3 + 3 + 7 rows, seven joints: reflections give `L Q` of the first six rows. The last level uses the one remaining
direction. The kernels compute only `v`. They compute no residuals and ranks, and do not test whether the result is correct.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from compiling import WIDEST, compiled
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Sizes of the arguments and of the result of one stack.
SIZES = {"pairs": ([8, 8, 2, 2], 4), "three": ([21, 21, 49, 3, 3, 7], 7)}

SOURCE = """
#include <math.h>
#include <initializer_list>
#define INLINE static inline __attribute__((always_inline))
#if WIDTH > 1
typedef double Real __attribute__((vector_size(8 * WIDTH)));
INLINE Real root(Real x) { for (int l = 0; l < WIDTH; l++) x[l] = sqrt(x[l]); return x; }
#else
typedef double Real;
INLINE Real root(Real x) { return sqrt(x); }
#endif
INLINE Real larger(Real a, Real b) { return a < b ? b : a; }
template <int N> INLINE Real dot(const Real* a, const Real* b) {
  Real s = a[0] * b[0];
  for (int i = 1; i < N; i++) s += a[i] * b[i];
  return s;
}
template <int N> INLINE void add(Real s, const Real* x, Real* y) { for (int i = 0; i < N; i++) y[i] += s * x[i]; }

INLINE void turned(const Real* A, Real e, Real r1, Real r2, Real* v, Real* below) {
  Real d = dot<4>(A + 4, A + 4) - dot<4>(A, A), w = 2.0 * dot<4>(A, A + 4);
  Real long_side = root(d * d + w * w + 1e-300);
  Real t = w / (d < 0.0 ? d - long_side : d + long_side), c = 1.0 / root(1.0 + t * t), s = t * c, g[4], h[4];
  for (int i = 0; i < 4; i++) { g[i] = c * A[i] - s * A[4 + i]; h[i] = s * A[i] + c * A[4 + i]; }
  Real p = 1.0 / larger(dot<4>(g, g), e), q = 1.0 / larger(dot<4>(h, h), e);
  add<4>(p * (c * r1 - s * r2), g, v);
  add<4>(q * (s * r1 + c * r2), h, v);
  if (below) for (int k = 0; k < 8; k += 4) {
    Real x = p * dot<4>(below + k, g), y = q * dot<4>(below + k, h);
    add<4>(-x, g, below + k);
    add<4>(-y, h, below + k);
  }
}
INLINE Real threshold(const Real* A) { return 4e-4 * larger(dot<4>(A, A), dot<4>(A + 4, A + 4)); }
INLINE void pairs(Real* const* in, Real* v) {
  Real *J1 = in[0], *J2 = in[1], *v1 = in[2], *v2 = in[3], A[8];
  for (int i = 0; i < 8; i++) A[i] = J2[i];
  for (int i = 0; i < 4; i++) v[i] = v1[0] * 0.0;
  turned(J1, threshold(J1), v1[0], v1[1], v, A);
  turned(A, threshold(J2), v2[0] - dot<4>(J2, v), v2[1] - dot<4>(J2 + 4, v), v, 0);
}

INLINE void three(Real* const* in, Real* v) {
  Real L[6][7], beta[6], y[7], z[7];
  for (int k = 0; k < 6; k++) for (int i = 0; i < 7; i++) L[k][i] = in[k / 3][k % 3 * 7 + i];
  for (int k = 0; k < 6; k++) {
    Real *w = L[k], norm = 0.0 * w[0];
    for (int i = k; i < 7; i++) norm += w[i] * w[i];
    norm = root(norm);
    Real alpha = w[k] < 0.0 ? norm : -norm, r = in[3 + k / 3][k % 3];
    for (int i = 0; i < k; i++) r -= w[i] * y[i];
    y[k] = r / alpha;
    beta[k] = 1.0 / (norm * (norm + (w[k] < 0.0 ? -w[k] : w[k])));
    w[k] -= alpha;
    for (int j = k + 1; j < 6; j++) {
      Real s = w[k] * L[j][k];
      for (int i = k + 1; i < 7; i++) s += w[i] * L[j][i];
      s *= beta[k];
      for (int i = k; i < 7; i++) L[j][i] -= s * w[i];
    }
  }
  for (int i = 0; i < 7; i++) z[i] = 0.0 * y[0];
  y[6] = z[6];
  z[6] += 1.0;
  for (int k = 5; k >= 0; k--) for (Real* x : {y, z}) {
    Real s = L[k][k] * x[k];
    for (int i = k + 1; i < 7; i++) s += L[k][i] * x[i];
    s *= beta[k];
    for (int i = k; i < 7; i++) x[i] -= s * L[k][i];
  }
  Real over = 0.0 * y[0], under = over;
  for (int k = 0; k < 7; k++) {
    Real a = dot<7>(in[2] + 7 * k, z);
    over += a * (in[5][k] - dot<7>(in[2] + 7 * k, y));
    under += a * a;
  }
  for (int i = 0; i < 7; i++) v[i] = y[i] + over / under * z[i];
}

// Stacks in rows, as the caller has them; one of them again and again where `again` is set.
template <int PARTS, int OUT, void (*one)(Real* const*, Real*)>
INLINE void all(const double* const* in, const int* size, double* out, long count, int again) {
  for (long first = 0; first < count; first += WIDTH) {
    Real x[128], v[OUT], *parts[PARTS], *to = x;
    for (int p = 0; p < PARTS; to += size[p++]) {
      parts[p] = to;
      for (int l = 0; l < WIDTH; l++) for (int i = 0; i < size[p]; i++)
        ((double*)(to + i))[l] = in[p][(again ? 0 : first + l) * size[p] + i];
    }
    one(parts, v);
    double* place = out + (again ? 0 : first * OUT);
    for (int l = 0; l < WIDTH; l++) for (int i = 0; i < OUT; i++) place[l * OUT + i] = ((double*)(v + i))[l];
    asm volatile("" ::: "memory");
  }
}
extern "C" void run_pairs(const double* const* in, double* out, long count, int again) {
  static constexpr int size[] = {8, 8, 2, 2};
  all<4, 4, pairs>(in, size, out, count, again);
}
extern "C" void run_three(const double* const* in, double* out, long count, int again) {
  static constexpr int size[] = {21, 21, 49, 3, 3, 7};
  all<6, 7, three>(in, size, out, count, again);
}
"""


def in_c(kernel: str, blocks: list[Array], velocities: list[Array], times: int) -> Callable[[], Array]:
    """A function that returns `v`. It solves one stack `times` times, or each row once if the arrays have three axes."""
    batch = blocks[0].ndim == 3
    library = compiled(f"#define WIDTH {WIDEST if batch else 1}\n{SOURCE}")
    sizes, n = SIZES[kernel]
    kept = [np.ascontiguousarray(part) for part in (*blocks, *velocities)]
    rows = len(kept[0]) if batch else 1
    assert [part.size for part in kept] == [rows * size for size in sizes] and rows % (WIDEST if batch else 1) == 0
    out = np.empty((rows, n) if batch else n)
    pointers = (ctypes.c_void_p * len(kept))(*(part.ctypes.data for part in kept))
    entry = getattr(library, f"run_{kernel}")
    given = (pointers, ctypes.c_void_p(out.ctypes.data), ctypes.c_long(rows if batch else times), ctypes.c_int(not batch))

    def run(_kept: Any = kept) -> Array:
        entry(*given)
        return out

    return run


def in_numba() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Two functions compiled by numba, for one stack and for many: two levels of two rows by one rotation per level."""
    import numba

    @numba.njit(inline="always")
    def turned(A: Any, e: float, r1: float, r2: float, v: Any, below: Any, last: bool) -> None:
        a = b = c = 0.0
        for i in range(4):
            a += A[0, i] * A[0, i]
            b += A[1, i] * A[1, i]
            c += A[0, i] * A[1, i]
        d, w = b - a, 2.0 * c
        root = np.sqrt(d * d + w * w + 1e-300)
        t = w / (d - root if d < 0.0 else d + root)
        cos = 1.0 / np.sqrt(1.0 + t * t)
        sin = t * cos
        p = q = 0.0
        for i in range(4):
            x, y = A[0, i], A[1, i]
            A[0, i], A[1, i] = cos * x - sin * y, sin * x + cos * y
            p += A[0, i] * A[0, i]
            q += A[1, i] * A[1, i]
        p, q = 1.0 / max(p, e), 1.0 / max(q, e)
        for i in range(4):
            v[i] += p * (cos * r1 - sin * r2) * A[0, i] + q * (sin * r1 + cos * r2) * A[1, i]
        if last:
            return
        for k in range(2):
            x = y = 0.0
            for i in range(4):
                x += below[k, i] * A[0, i]
                y += below[k, i] * A[1, i]
            for i in range(4):
                below[k, i] -= p * x * A[0, i] + q * y * A[1, i]

    @numba.njit(inline="always")
    def solved(J1: Any, J2: Any, v1: Any, v2: Any, v: Any, A: Any, B: Any) -> None:
        most1 = most2 = 0.0
        for k in range(2):
            s1 = s2 = 0.0
            for i in range(4):
                A[k, i], B[k, i] = J1[k, i], J2[k, i]
                s1 += J1[k, i] * J1[k, i]
                s2 += J2[k, i] * J2[k, i]
            most1, most2 = max(most1, s1), max(most2, s2)
        v[:] = 0.0
        turned(A, 4e-4 * most1, v1[0], v1[1], v, B, False)
        r1, r2 = v2[0], v2[1]
        for i in range(4):
            r1 -= J2[0, i] * v[i]
            r2 -= J2[1, i] * v[i]
        turned(B, 4e-4 * most2, r1, r2, v, A, True)

    @numba.njit
    def one(J1: Any, J2: Any, v1: Any, v2: Any) -> Any:
        v, A, B = np.empty(4), np.empty((2, 4)), np.empty((2, 4))
        solved(J1, J2, v1, v2, v, A, B)
        return v

    @numba.njit
    def many(J1: Any, J2: Any, v1: Any, v2: Any) -> Any:
        v, A, B = np.empty((len(v1), 4)), np.empty((2, 4)), np.empty((2, 4))
        for i in range(len(v1)):
            solved(J1[i], J2[i], v1[i], v2[i], v[i], A, B)
        return v

    return one, many
