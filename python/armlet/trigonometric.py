"""Trigonometric polynomials with exact coefficients, and the shortest of several forms of each.

    plain      polynomials in sin q_i and cos q_i, factored:           l sin(q2) (v1 + v2)
    angles     sums of sines and cosines of sums of angles:            cos(q2 + q3) - cos(q2 - q3)
    absolute   as plain, in the angles phi_i = q_i +- phi_parent of     (l2 cos(q2) + l3 cos(q2 + q3))^2
               joints with parallel axes (- if the axes are opposite)

A sum of products of velocities, each with a polynomial as factor, is grouped by equal polynomials or by equal sines and cosines.

Sines and cosines are generators of a polynomial ring over the rational numbers. After every product `sin^2` is replaced by `1 - cos^2`. A
number of the arm is converted to the decimal that Python prints for it. If an integer is closer than 1e-15 (NEAR_INTEGER), the number
becomes this integer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from importlib import import_module
from itertools import product
from typing import Any, TypeAlias

__all__ = ["Polynomials"]

#: A sum of complex exponentials, called waves. A key has one wave number per joint; a value has the real and the imaginary part of the
#: amplitude.
Waves: TypeAlias = dict[tuple[int, ...], Any]

#: An entry of a rotation that is closer to an integer than this is that integer. In float64 the cosine of pi/2 is 6e-17.
NEAR_INTEGER = 1e-15
#: Polynomials with more terms are not factored, because factoring takes long.
MOST_FACTORED = 12
#: Polynomials with longer coefficients (bits of numerator and denominator together) are not factored.
MOST_BITS = 64
#: Rational numbers with these denominators are printed as fractions. All others are printed as decimals.
FRACTIONS = (1, 2, 4, 8)


class Polynomials:
    """The polynomial ring of one arm.

    Its generators are the sine and the cosine of each joint, the coordinates, and the symbols `lengths` of offsets and gravity. Polynomials
    use the sine and cosine of a revolute joint, and the coordinate of a prismatic joint.
    """

    def __init__(
        self, sympy: Any, q: Sequence[Any], slides: Sequence[bool], parallel: Sequence[tuple[int, int]], lengths: Sequence[Any]
    ) -> None:
        self.sympy, self.q, self.slides, self.lengths = sympy, tuple(q), list(slides), list(lengths)
        self.n = len(q)
        # Pairs (parent, sign) for phi_i = q_i + sign phi_parent; parent -1 if the axes are not parallel.
        self.parallel = list(parallel)
        rings, self.domain = import_module("sympy.polys.rings"), import_module("sympy.polys.domains").QQ
        trig = [f"{kind}{i}" for i in range(self.n) for kind in ("sin", "cos")]
        self.others = [*q, *lengths]
        self.ring, *self.gens = rings.ring([*trig, *map(str, self.others)], self.domain)
        self.zero = self.ring.zero
        self._known: dict[Any, Any] = {}
        self._products: dict[Any, Any] = {}

    def number(self, x: float) -> Any:
        whole = round(x)
        return self.ring.ground_new(self.domain.convert(Fraction(whole) if abs(x - whole) < NEAR_INTEGER else Fraction(repr(float(x)))))

    def length(self, symbol: Any) -> Any:
        return self.gens[3 * self.n + self.lengths.index(symbol)]

    def angle(self, i: int) -> Any:
        """The generator of the polynomial ring for the coordinate of the prismatic joint `i`."""
        return self.gens[2 * self.n + i]

    def rotation(self, i: int, axis: Sequence[Any]) -> list[list[Any]]:
        """The rotation matrix about `axis` by the angle of joint `i`: `1 + sin K + (1 - cos) K^2`, where `K v`
        is the cross product of `axis` and `v`."""
        s, c = self.gens[2 * i], self.gens[2 * i + 1]
        x, y, z = axis
        K = [[self.zero, -z, y], [z, self.zero, -x], [-y, x, self.zero]]
        square = [[sum((K[r][m] * K[m][k] for m in range(3)), self.zero) for k in range(3)] for r in range(3)]
        return [[s * K[r][k] + (1 - c) * square[r][k] + int(r == k) for k in range(3)] for r in range(3)]

    def reduced(self, p: Any, keep_sines: bool = False) -> Any:
        """Replace `sin^2` by `1 - cos^2`, or, if `keep_sines`, `cos^2` by `1 - sin^2`."""
        for i in range(self.n):
            out, kept = (2 * i + 1, 2 * i) if keep_sines else (2 * i, 2 * i + 1)
            while any(monomial[out] > 1 for monomial in p):
                low, high = self.ring.zero, self.ring.zero
                for monomial, coefficient in p.terms():
                    if monomial[out] > 1:
                        rest = list(monomial)
                        rest[out] -= 2
                        high[tuple(rest)] = coefficient
                    else:
                        low[monomial] = coefficient
                p = low + high * (1 - self.gens[kept] ** 2)
        return p

    def slope(self, p: Any, i: int) -> Any:
        """The derivative of `p` with respect to coordinate `i`."""
        if self.slides[i]:
            return p.diff(self.angle(i))
        s, c = self.gens[2 * i], self.gens[2 * i + 1]
        return self.reduced(p.diff(s) * c - p.diff(c) * s)

    def christoffel(self, mass: Sequence[Sequence[Any]]) -> list[list[list[Any]]]:
        """The Christoffel symbols `c[i][j][k] = (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) / 2`."""
        joints = range(self.n)
        D = [[[self.slope(mass[i][j], k) for k in joints] for j in joints] for i in joints]
        half = self.domain(1, 2)
        return [[[(D[i][j][k] + D[i][k][j] - D[j][k][i]) * half for k in joints] for j in joints] for i in joints]

    def readable(self, p: Any) -> Any:
        """The shortest form of `p`, as a sympy expression."""
        key = frozenset(p.items())
        if key not in self._known:
            self._known[key] = self._decimals(min(self._forms(p), key=self.sympy.count_ops))
        return self._known[key]

    def collected(self, terms: Sequence[tuple[Any, Any]]) -> Any:
        """The sum over pairs (rate, p) of `rate` times `p`, in the shorter of two forms. A rate is a product of velocities."""
        by_polynomial = self._grouped(terms, self.readable)
        if not all(self._short(p) for _, p in terms):
            return self._decimals(by_polynomial)
        waves: dict[Any, list[tuple[Any, Any]]] = {}
        for rate, p in terms:
            for wave, amplitude in self._amplitudes(p):
                waves.setdefault(wave, []).append((rate, amplitude))
        by_wave = self.sympy.Add(*(wave * self._grouped(own, self._factored) for wave, own in waves.items()))
        return self._decimals(min(by_polynomial, by_wave, key=self.sympy.count_ops))

    def _grouped(self, terms: Sequence[tuple[Any, Any]], written: Callable[[Any], Any]) -> Any:
        """Group the rates of polynomials that differ only by a constant factor."""
        groups: dict[Any, tuple[Any, list[Any]]] = {}
        for rate, p in terms:
            if p:
                first, rates = groups.setdefault(frozenset(p.monic().items()), (p, []))
                rates.append(self.domain.to_sympy(p.LC / first.LC) * rate)
        return self.sympy.Add(*(self.sympy.Add(*rates) * written(first) for first, rates in groups.values()))

    def _decimals(self, expression: Any) -> Any:
        rationals = {r: self.sympy.Float(r, 15) for r in expression.atoms(self.sympy.Rational) if r.q not in FRACTIONS}
        return expression.xreplace(rationals)

    def _forms(self, p: Any) -> Iterable[Any]:
        yield self._factored(p)
        if not self._short(p):
            return
        yield self._factored(self.reduced(p, keep_sines=True))
        yield self.sympy.Add(*(wave * self._factored(amplitude) for wave, amplitude in self._amplitudes(p)))
        if any(parent >= 0 for parent, _ in self.parallel):
            absolute = self._absolute(self._waves(p))
            yield self._factored(absolute, True)
            yield self._factored(self.reduced(absolute, keep_sines=True), True)

    def _symbols(self, angles: Sequence[Any]) -> list[Any]:
        """A sympy expression for each generator: sine and cosine of each of `angles`, then the coordinates and `lengths`."""
        sin, cos = self.sympy.sin, self.sympy.cos
        return [f(angle) for angle in angles for f in (sin, cos)] + self.others

    def _factored(self, p: Any, absolute: bool = False) -> Any:
        """The polynomial as a product, with sines and cosines of `q`, or of `phi` if `absolute`."""
        key = (frozenset(p.items()), absolute)
        if key not in self._products:
            self._products[key] = self._product(p, self._symbols(self._turns() if absolute else self.q))
        return self._products[key]

    def _short(self, p: Any) -> bool:
        """Whether all coefficients have at most MOST_BITS bits."""
        return all(coefficient.numerator.bit_length() + coefficient.denominator.bit_length() <= MOST_BITS for coefficient in p.values())

    def _product(self, p: Any, symbols: list[Any]) -> Any:
        # Factoring uses dense algorithms, which are slow for many generators. So the ring is reduced to the generators of `p`.
        used = [i for i in range(len(self.gens)) if any(monomial[i] for monomial in p)]
        if len(p) < 2 or len(p) > MOST_FACTORED or not self._short(p):
            return p.as_expr(*symbols)
        ring = self.ring.clone(symbols=[self.ring.symbols[i] for i in used])
        small = ring.from_dict({tuple(monomial[i] for i in used): coefficient for monomial, coefficient in p.items()})
        own = [symbols[i] for i in used]
        content, factors = small.factor_list()
        expressions = []
        for factor, power in factors:
            # A numeric factor is multiplied into the polynomial: 0.06 + 0.3 cos q instead of 3 (2 + 10 cos q) / 100.
            if power == 1 and content != 1 and any(abs(coefficient) != 1 for coefficient in factor.coeffs()):
                factor, content = factor * content, self.domain.one
            expressions.append(factor.as_expr(*own) ** power)
        return self.sympy.Mul(self.domain.to_sympy(content), *expressions)

    def _waves(self, p: Any) -> Waves:
        """The waves of `p = sum_k X_k exp(i k.q)`. The real and imaginary part of each `X_k` are polynomials in the other generators."""
        half = self.domain(1, 2)
        found: Waves = {}
        for monomial, coefficient in p.terms():
            other = (*[0] * (2 * self.n), *monomial[2 * self.n :])
            # Waves of the monomial's sines and cosines: sin = -i/2 (z - 1/z), cos = 1/2 (z + 1/z), z = exp(i q).
            parts = {(0,) * self.n: (coefficient, self.domain.zero)}
            for i in range(self.n):
                for turn, times in ((-1, monomial[2 * i]), (1, monomial[2 * i + 1])):
                    for _ in range(times):
                        parts = _times(parts, i, half, sine=turn < 0)
            for k, (real, imaginary) in parts.items():
                for part, value in enumerate((real, imaginary)):
                    if value:
                        sums = found.setdefault(k, (self.ring.zero.copy(), self.ring.zero.copy()))
                        sums[part][other] = sums[part].get(other, self.domain.zero) + value
        return {k: tuple(self._clean(part) for part in parts) for k, parts in found.items()}

    def _clean(self, p: Any) -> Any:
        p.strip_zero()
        return p

    def _amplitudes(self, p: Any) -> Iterable[tuple[Any, Any]]:
        """The sines and cosines in `p` with their amplitudes.

        `X_k exp(i k.q)` plus its conjugate is `2 Re X_k cos(k.q) - 2 Im X_k sin(k.q)`.
        """
        for k, (real, imaginary) in self._waves(p).items():
            leading = next((x for x in k if x), 0)
            angle = self.sympy.Add(*(x * q for x, q in zip(k, self.q, strict=True)))
            if leading == 0:
                yield self.sympy.S.One, real
            elif leading > 0:
                yield self.sympy.cos(angle), 2 * real
                yield self.sympy.sin(angle), -2 * imaginary

    def _turns(self) -> list[Any]:
        """The angles `phi_i` as sums of `q`."""
        found: list[Any] = []
        for q, (parent, sign) in zip(self.q, self.parallel, strict=True):
            found.append(q + sign * found[parent] if parent >= 0 else q)
        return found

    def _absolute(self, waves: Waves) -> Any:
        """The polynomial of these waves, with the generators as sines and cosines of `phi`."""
        total = self.zero
        for k, (real, imaginary) in waves.items():
            turned = list(k)
            for i in reversed(range(self.n)):
                parent, sign = self.parallel[i]
                if parent >= 0:
                    turned[parent] -= sign * k[i]
            # exp(i k phi) = prod (cos +- i sin)^|k|
            wave = (self.ring.one, self.ring.zero)
            for i, x in enumerate(turned):
                s, c = self.gens[2 * i] * (1 if x > 0 else -1), self.gens[2 * i + 1]
                for _ in range(abs(x)):
                    wave = (self.reduced(wave[0] * c - wave[1] * s), self.reduced(wave[0] * s + wave[1] * c))
            total += wave[0] * real - wave[1] * imaginary
        return self.reduced(total)


def _times(parts: dict[tuple[int, ...], tuple[Any, Any]], i: int, half: Any, sine: bool) -> dict[tuple[int, ...], tuple[Any, Any]]:
    """The product of `sin q_i` (if `sine`) or `cos q_i` and a sum of waves."""
    found: dict[tuple[int, ...], tuple[Any, Any]] = {}
    for (k, (real, imaginary)), step in product(parts.items(), (1, -1)):
        # The factor of a sine: -i/2 step (real + i imaginary) = step (imaginary - i real) / 2.
        a, b = (step * imaginary * half, -step * real * half) if sine else (real * half, imaginary * half)
        to = (*k[:i], k[i] + step, *k[i + 1 :])
        old = found.get(to, (0 * a, 0 * b))
        found[to] = (old[0] + a, old[1] + b)
    return found
