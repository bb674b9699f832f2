"""Formulas of small arms, which `Arm.symbolic` returns.

    M(q) a + C(q, v) v + g(q) = tau,   Y(q, v, v_r, a_r) pi = M a_r + C v_r + g

Y is the regressor. In the second equation, M excludes the rotor inertia. So M is linear in the inertial parameters pi,
`M = sum_k pi_k M_k`, and so are C and g. The factor of each pi_k is a polynomial in sines and cosines of angles, and in positions of
prismatic joints. `armlet.trigonometric` writes each polynomial in the shortest of several forms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import InputError
from .extras import extra
from .trigonometric import Polynomials

__all__ = ["Formulas", "of_planar_pr", "of_tree"]

Array: TypeAlias = NDArray[np.float64]
#: Index of the parent joint (-1: the base), rotation matrix (a list of rows) and offset (m) in the parent's axes, joint axis, whether the
#: joint is prismatic, ten inertial parameters, rotor inertia.
Joint: TypeAlias = tuple[int, list[list[float]], list[float], list[float], bool, list[float], float]

#: Index of the coordinate that moves a joint, multiplier and offset.
Row: TypeAlias = tuple[int, float, float]

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
AXES = "xyz"
#: The arguments of each matrix function.
ARGUMENTS = {"M": ("q",), "C": ("q", "v"), "g": ("q",), "Y": ("q", "v", "v_r", "a_r")}


def _sympy() -> Any:
    return extra("symbolic", "sympy", "sympy")


@dataclass(frozen=True, eq=False, repr=False)
class Formulas:
    """`M(q)`, `C(q, v)`, `g(q)` and the regressor `Y(q, v, v_r, a_r)` of an arm as sympy matrices. `C` is the Christoffel form.

    >>> import armlet as al
    >>> formulas = al.planar_pr(2.0, 0.5, 0.5).symbolic()
    >>> formulas.C
    Matrix([
    [0, -B*v2*sin(q2)],
    [0,             0]])
    >>> print(formulas.latex("M"))
    M = \\left[\\begin{matrix}A & B \\cos{\\left(q_{2} \\right)}\\\\B \\cos{\\left(q_{2} \\right)} & C\\end{matrix}\\right]
    """

    #: Symbols of positions, velocities, reference velocities and reference accelerations, n each.
    q: tuple[Any, ...]
    v: tuple[Any, ...]
    v_r: tuple[Any, ...]
    a_r: tuple[Any, ...]
    M: Any
    C: Any
    #: The gravity torque, (n, 1).
    g: Any
    #: The regressor, (n, p), with columns in the order of `Arm.parameters`.
    Y: Any
    #: The arm's values of all other symbols, in SI units.
    values: Mapping[Any, float]

    def latex(self, name: str | None = None) -> str:
        """Return the matrix `name` as LaTeX. None: all four matrices as lines of an `aligned` block.

        Raises:
            InputError: `name` is not one of the matrices.
        """
        if name is not None:
            return f"{name} = {self._latex(self._matrix('latex', name))}"
        lines = [rf"{name} &= {self._latex(getattr(self, name))}" for name in ARGUMENTS]
        return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"

    def _latex(self, matrix: Any) -> str:
        return str(_sympy().latex(matrix, symbol_names={symbol: _name(str(symbol)) for symbol in (*self.v_r, *self.a_r, *self.values)}))

    def function(self, name: str, values: Mapping[Any, float] | None = None) -> Callable[..., Array]:
        """Return the matrix `name` as a function of arrays: `M(q)`, `C(q, v)`, `g(q)`, `Y(q, v, v_r, a_r)`.

        Args:
            name: "M", "C", "g" or "Y".
            values: numbers by symbol. They replace the arm's values, and each symbol must be a key of the attribute `values`.

        Returns:
            A function of arrays `(..., n)`. It returns `(..., n, n)` for `M` and `C`, `(..., n)` for `g`, `(..., n, p)` for `Y`.

        Raises:
            InputError: `name` is not one of the matrices, or a symbol is unknown.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).symbolic().function("M")([0.0, 0.0]).tolist()
        [[2.0, 0.5], [0.5, 0.5]]
        """
        matrix, given = self._matrix("function", name), dict(values or {})
        unknown = [str(symbol) for symbol in given if symbol not in self.values]
        if unknown:
            known = ", ".join(map(str, self.values))
            raise InputError(f"function: values name what this arm has not: expected symbols among {known}, got {', '.join(unknown)}")
        arguments = ARGUMENTS[name]
        symbols = [symbol for argument in arguments for symbol in getattr(self, argument)]
        numbers = {**self.values, **given}
        entries = _sympy().lambdify([*symbols, *numbers], list(matrix), modules="numpy", cse=True)
        shape = matrix.shape if name != "g" else matrix.shape[:1]
        n = len(self.q)

        def evaluate(*states: Any) -> Array:
            if len(states) != len(arguments):
                raise InputError(f"{name}: has the wrong number of arguments: expected {', '.join(arguments)}, got {len(states)}")
            arrays = [_core.numbers(name, argument, state) for argument, state in zip(arguments, states, strict=True)]
            for argument, array in zip(arguments, arrays, strict=True):
                if array.shape[-1:] != (n,):
                    raise InputError(f"{name}: {argument} has the wrong shape: expected (..., {n}), got {array.shape}")
            lead = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
            columns = [array[..., i] for array in arrays for i in range(n)]
            found = [np.broadcast_to(entry, lead) for entry in entries(*columns, *numbers.values())]
            return np.stack(found, axis=-1).reshape(*lead, *shape)

        return evaluate

    def _matrix(self, caller: str, name: str) -> Any:
        if name not in ARGUMENTS:
            raise InputError(f"{caller}: name is unknown: expected one of {', '.join(ARGUMENTS)}, got {name!r}")
        return getattr(self, name)

    def __repr__(self) -> str:
        lines = [f"{name} = {getattr(self, name)}" for name in ("M", "C", "g")]
        return "\n".join([f"<Formulas of {len(self.q)} joints, Y has shape {self.Y.shape}>", *lines])


def _name(symbol: str) -> str:
    """The name of a symbol in LaTeX."""
    kind = symbol.rstrip("0123456789")
    joint = symbol[len(kind) :]
    if kind.startswith("mc"):
        return f"m_{{{joint}}} c_{{{kind[2]},{joint}}}"
    if kind.startswith("I"):
        return f"I_{{{kind[1:]},{joint}}}"
    if kind.endswith("_r"):
        return f"{kind[0]}_{{r{joint}}}"
    if len(kind) == 2:
        return f"{kind[0]}_{{{kind[1]}}}"
    return f"{kind}_{{{joint}}}" if joint else kind


def _symbols(sympy: Any, n: int) -> Iterator[tuple[Any, ...]]:
    for kind in ("q", "v", "v_r", "a_r"):
        yield tuple(sympy.Symbol(f"{kind}{i + 1}", real=True) for i in range(n))


def of_planar_pr(parameters: Sequence[float]) -> Formulas:
    """The formulas of the arm `planar_pr`: `M = [[A, B cos q2], [B cos q2, C]]`, `C = [[0, -B sin(q2) v2], [0, 0]]`, `g = 0`."""
    sympy = _sympy()
    q, v, v_r, a_r = _symbols(sympy, 2)
    A, B, C = symbols = sympy.symbols("A B C", real=True)
    sin, cos = sympy.sin(q[1]), sympy.cos(q[1])
    return Formulas(
        q=q,
        v=v,
        v_r=v_r,
        a_r=a_r,
        M=sympy.ImmutableMatrix([[A, B * cos], [B * cos, C]]),
        C=sympy.ImmutableMatrix([[0, -B * sin * v[1]], [0, 0]]),
        g=sympy.ImmutableMatrix([[0], [0]]),
        Y=sympy.ImmutableMatrix([[a_r[0], a_r[1] * cos - v[1] * v_r[1] * sin, 0], [0, a_r[0] * cos, a_r[1]]]),
        values=dict(zip(symbols, parameters, strict=True)),
    )


def of_tree(joints: Sequence[Joint], gravity: Sequence[float], lengths: bool, rows: Sequence[Row] | None = None) -> Formulas:
    """The formulas of a tree of bodies, from the energy of each body in the body's axes.

    `lengths`: whether offsets of joints and gravity are symbols; otherwise they are numbers. `rows` describes mimic joints.
    """
    formulas = _of_bodies(joints, gravity, lengths)
    return formulas if rows is None else _joined(formulas, rows)


def _joined(bodies: Formulas, rows: Sequence[Row]) -> Formulas:
    """The formulas of an arm with mimic joints, `q_b = G q + c`: `G' M G`, `G' C G`, `G' g`, `G' Y` at the bodies' positions and rates."""
    sympy = _sympy()
    n = 1 + max(coordinate for coordinate, *_ in rows)
    q, v, v_r, a_r = states = tuple(_symbols(sympy, n))
    exact = [(k, sympy.nsimplify(m), sympy.nsimplify(c)) for k, m, c in rows]
    G = sympy.Matrix(len(rows), n, lambda i, k: exact[i][1] if exact[i][0] == k else 0)
    at: dict[Any, Any] = {}
    for own, state in zip((bodies.q, bodies.v, bodies.v_r, bodies.a_r), states, strict=True):
        at |= {x: m * state[k] + (c if own is bodies.q else 0) for x, (k, m, c) in zip(own, exact, strict=True)}

    def projected(matrix: Any) -> Any:
        return sympy.ImmutableMatrix(G.T * matrix.subs(at, simultaneous=True))

    M, C = (sympy.ImmutableMatrix(projected(matrix) * G) for matrix in (bodies.M, bodies.C))
    return Formulas(q, v, v_r, a_r, M, C, projected(bodies.g), projected(bodies.Y), bodies.values)


def _of_bodies(joints: Sequence[Joint], gravity: Sequence[float], lengths: bool) -> Formulas:
    sympy = _sympy()
    n = len(joints)
    q, v, v_r, a_r = _symbols(sympy, n)
    numbers = {f"{axis}{i + 1}": x for i, joint in enumerate(joints) for axis, x in zip(AXES, joint[2], strict=True)}
    numbers |= {f"g{axis}": x for axis, x in zip(AXES, gravity, strict=True)}
    values = {sympy.Symbol(name, real=True): x for name, x in numbers.items() if lengths and x != 0.0}
    trig = Polynomials(sympy, q, [joint[4] for joint in joints], _runs(joints), list(values))
    given = {str(symbol): trig.length(symbol) for symbol in values}
    placed = [given.get(name) or trig.number(x) for name, x in numbers.items()]
    offsets, down = [placed[3 * i : 3 * i + 3] for i in range(n)], placed[3 * n :]
    mass, slope = _unit_energies(trig, joints, offsets, down)
    symbols = [[sympy.Symbol(f"{kind}{i + 1}", real=True) for kind in PARAMETERS] for i in range(n)]
    rotors = [sympy.Symbol(f"Ir{i + 1}", real=True) for i in range(n)]
    used = [(i, k) for i in range(n) for k in range(10) if joints[i][5][k] != 0.0]
    own = {symbols[i][k]: joints[i][5][k] for i, k in used} | {rotors[i]: joints[i][6] for i in range(n) if joints[i][6] != 0.0}
    christoffel = {part: trig.christoffel(mass[part]) for part in mass}

    def summed(entry: Callable[[tuple[int, int]], Any]) -> Any:
        return sympy.Add(*(symbols[i][k] * entry((i, k)) for i, k in used))

    def coriolis(part: tuple[int, int], j: int, k: int) -> Any:
        return trig.collected(list(zip(v, christoffel[part][j][k], strict=True)))

    def column(part: tuple[int, int], j: int) -> Any:
        """Entry `j` of `M a_r + C v_r + g` if the parameter `part` is 1 and all others are 0: an entry of the regressor."""
        terms = list(zip(a_r, mass[part][j], strict=True))
        terms += [(v[l] * v_r[k], christoffel[part][j][k][l]) for k in range(n) for l in range(n)]
        return trig.collected([*terms, (sympy.S.One, slope[part][j])])

    rows = range(n)
    M = sympy.Matrix(n, n, lambda j, k: summed(lambda part: trig.readable(mass[part][j][k])))
    M += sympy.diag(*(rotors[i] if joints[i][6] != 0.0 else 0 for i in rows))
    C = sympy.ImmutableMatrix(n, n, lambda j, k: summed(lambda part: coriolis(part, j, k)))
    g = sympy.ImmutableMatrix(n, 1, lambda j, _: summed(lambda part: trig.readable(slope[part][j])))
    Y = sympy.ImmutableMatrix([[column((i, k), j) for i in rows for k in range(10)] for j in rows])
    seen = set().union(*(matrix.free_symbols for matrix in (M, C, g, Y)))
    numbers_of = {symbol: x for symbol, x in (own | values).items() if symbol in seen}
    return Formulas(q, v, v_r, a_r, sympy.ImmutableMatrix(M), C, g, Y, numbers_of)


def _runs(joints: Sequence[Joint]) -> list[tuple[int, int]]:
    """For each joint (parent, sign) if it and its parent rotate about parallel axes; else (-1, 1). The sign is -1 for opposite axes."""
    found = []
    for parent, rotation, _, axis, slides, *_ in joints:
        along = 0.0
        if parent >= 0 and not slides and not joints[parent][4]:
            along = float(np.asarray(rotation) @ axis @ joints[parent][3])
        found.append((parent, round(along)) if abs(abs(along) - 1.0) < 1e-12 else (-1, 1))
    return found


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit_energies(
    trig: Polynomials, joints: Sequence[Joint], offsets: Sequence[Sequence[Any]], gravity: Sequence[Any]
) -> tuple[dict[tuple[int, int], Any], dict[tuple[int, int], Any]]:
    """The mass matrix `M` (n, n) and the gravity torque `g` (n,) for each parameter `(body, kind)`, if it is 1 and all others are 0.

    All vectors are in the axes of the body. `u_j` and `w_j` are the velocity of its origin and its angular velocity for a unit rate of
    joint `j`. Then `M_jk = m u_j.u_k + u_j.(w_k x h) + u_k.(w_j x h) + w_j.I w_k`, and `g_j = -(m gamma.u_j + gamma.(w_j x h))`. Here `m`
    is the mass, `h` the first moment, `I` the inertia about the origin, and `gamma` the acceleration of gravity.
    """
    n, zero = len(joints), trig.zero
    unit = [[trig.number(float(i == k)) for i in range(3)] for k in range(3)]
    still = [[zero] * 3 for _ in range(n)]
    moved: list[tuple[list[list[Any]], list[list[Any]], list[Any]]] = []
    mass: dict[tuple[int, int], Any] = {}
    slope: dict[tuple[int, int], Any] = {}
    for i, (parent, rotation, _, axis, slides, *_) in enumerate(joints):
        u_p, w_p, down_p = moved[parent] if parent >= 0 else (still, still, gravity)
        turn = [[trig.number(x) for x in row] for row in rotation]
        along = [trig.number(x) for x in axis]
        reach = list(offsets[i])
        if slides:
            reach = [trig.reduced(reach[r] + _dot(turn[r], along) * trig.angle(i)) for r in range(3)]
        else:
            turn = [[trig.reduced(_dot(row, column)) for column in zip(*trig.rotation(i, along), strict=True)] for row in turn]

        def here(x: Sequence[Any], turn: list[list[Any]] = turn) -> list[Any]:
            return [trig.reduced(_dot([turn[r][c] for r in range(3)], x)) for c in range(3)]

        u = [here([a + b for a, b in zip(u_p[j], _cross(w_p[j], reach), strict=True)]) for j in range(n)]
        w = [here(w_p[j]) for j in range(n)]
        if slides:
            u[i] = along
        else:
            w[i] = along
        down = here(down_p)
        moved.append((u, w, down))
        for kind in range(10):
            M = [[zero] * n for _ in range(n)]
            for j in range(n):
                for k in range(j, n):
                    if kind == 0:
                        entry = _dot(u[j], u[k])
                    elif kind < 4:
                        h = unit[kind - 1]
                        entry = _dot(u[j], _cross(w[k], h)) + _dot(u[k], _cross(w[j], h))
                    else:
                        a, b = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))[kind - 4]
                        entry = w[j][a] * w[k][b] + (w[j][b] * w[k][a] if a != b else zero)
                    M[j][k] = M[k][j] = trig.reduced(entry)
            mass[i, kind] = M
            if kind == 0:
                slope[i, kind] = [trig.reduced(-_dot(down, u[j])) for j in range(n)]
            elif kind < 4:
                slope[i, kind] = [trig.reduced(-_dot(down, _cross(w[j], unit[kind - 1]))) for j in range(n)]
            else:
                slope[i, kind] = [zero] * n
    return mass, slope
