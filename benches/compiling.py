"""C++ that g++ compiles for this processor and ctypes loads. Compiled libraries are stored in `benches/results/generated_c`.

Lanes are the elements of a vector of GNU C: eight doubles with AVX-512, four with AVX2. Sine and cosine of a vector are polynomials, with
the argument reduction of Cody and Waite and the coefficients of FreeBSD's msun.
"""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import subprocess
from pathlib import Path

import timing

BUILT = Path(__file__).parent / "results" / "generated_c"
FLAGS = "-O3 -march=native -ffp-contract=fast -fno-math-errno -fno-tree-slp-vectorize -shared -fPIC -w -std=c++17".split()
WIDEST = {"AVX-512": 8, "AVX2": 4}.get(timing.machine()["simd"], 2)
INLINE = "static inline __attribute__((always_inline))"

LANES = """
typedef double Vector __attribute__((vector_size(8 * WIDTH)));
typedef long long Bits __attribute__((vector_size(8 * WIDTH)));
struct Real { Vector v; Real() {} Real(double x) : v(x - (Vector){}) {} Real(Vector x) : v(x) {} };
INLINE Real operator+(Real a, Real b) { return Real(a.v + b.v); }
INLINE Real operator-(Real a, Real b) { return Real(a.v - b.v); }
INLINE Real operator*(Real a, Real b) { return Real(a.v * b.v); }
INLINE Real operator/(Real a, Real b) { return Real(a.v / b.v); }
INLINE Real operator-(Real a) { return Real(-a.v); }
// sin(x) for first = 0, cos(x) for first = 1: the quarter turn nearest to x, and polynomials of what remains.
INLINE Vector wave(Vector x, long long first) {
  const double whole = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer, which is then in the low bits
  Vector shifted = x * 0.63661977236758134308 + whole, turns = shifted - whole;
  Bits quarter = (Bits)shifted + first;
  Vector r = (x - turns * 1.57079632673412561417e+00) - turns * 6.07710050650619224932e-11, z = r * r;
  Vector s = z * (z * (z * (z * (z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08) + 2.75573137070700676789e-06)
    - 1.98412698298579493134e-04) + 8.33333333332248946124e-03) - 1.66666666666666324348e-01;
  Vector c = z * (z * (z * (z * (z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09) - 2.75573143513906633035e-07)
    + 2.48015872894767294178e-05) - 1.38888888888741095749e-03) + 4.16666666666666019037e-02;
  Vector sine = r * z * s + r, cosine = z * z * c + (1.0 - 0.5 * z), value = ((quarter & 1) != 0) ? cosine : sine;
  return (Vector)((Bits)value ^ ((quarter & 2) << 62));
}
INLINE Real sqrt(Real x) { Vector y; for (int i = 0; i < WIDTH; i++) y[i] = __builtin_sqrt(x.v[i]); return Real(y); }
INLINE Real operator<(Real a, Real b) { return Real((a.v < b.v) ? 1.0 - (Vector){} : (Vector){}); }
INLINE Real operator!(Real a) { return Real((a.v == 0.0) ? 1.0 - (Vector){} : (Vector){}); }
INLINE Real take(Real where, Real a) { return Real((where.v != 0.0) ? a.v : (Vector){}); }
INLINE Real larger(Real a, Real b) { return Real((a.v > b.v) ? a.v : b.v); }
INLINE Real smaller(Real a, Real b) { return Real((a.v < b.v) ? a.v : b.v); }
INLINE Real sin(Real x) { return Real(wave(x.v, 0)); }
INLINE Real cos(Real x) { return Real(wave(x.v, 1)); }
"""


def compiled(code: str) -> ctypes.CDLL:
    """The code as a loaded library. It is compiled only once.

    Raises:
        ImportError: g++ is not installed.
    """
    compiler = shutil.which("g++")
    if compiler is None:
        raise ImportError("no g++")
    BUILT.mkdir(parents=True, exist_ok=True)
    path = BUILT / f"{hashlib.sha256((code + str(FLAGS) + timing.machine()['cpu']).encode()).hexdigest()[:16]}.cpp"
    library = path.with_suffix(".so")
    if not library.exists():
        path.write_text(code)
        subprocess.run([compiler, *FLAGS, str(path), "-o", str(path.with_suffix(".part"))], check=True)
        path.with_suffix(".part").rename(library)
    return ctypes.CDLL(str(library))
