"""Loops as WebAssembly, executed by wasmtime: the bits of runs with the instruction set `baseline`, and random programs."""

from __future__ import annotations

import ctypes
import json
import math
import os
import platform
import random
import subprocess
import sys
from base64 import b64decode
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
import web_loops
from web_loops import LOOPS, STEPS, WebRun, page

import armlet as al
from armlet import _core
from armlet.web.export import page_data

#: The baseline of other processors has fused multiply-add, which rounds once. Their runs differ from a page by rounding.
SAME_BITS = platform.machine().lower() in ("x86_64", "amd64")


@pytest.fixture(scope="module")
def baseline(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The records and the pages of all loops, from a process with the instruction set `baseline`.

    The numbers of a set-up also depend on the instruction set.
    """
    folder = tmp_path_factory.mktemp("baseline")
    records, pages = folder / "records.npz", folder / "pages.json"
    command = [sys.executable, "-P", web_loops.__file__, str(records), str(pages)]
    path = os.pathsep.join([str(Path(models.__file__).parent), os.environ.get("PYTHONPATH", "")])
    subprocess.run(command, env=os.environ | {"ARMLET_ISA": "baseline", "PYTHONPATH": path}, check=True, timeout=300)
    return np.load(records), json.loads(pages.read_text())


@pytest.mark.parametrize("name", LOOPS)
def test_steps_have_the_bits_of_the_baseline(name: str, baseline: Any) -> None:
    runs, pages = baseline
    web, states, records = WebRun(pages[name]), runs[f"{name}/x"], runs[f"{name}/record"]
    for k in range(STEPS + 1):
        record, x = web.record(), web.group("state")[: states.shape[1]]
        if SAME_BITS:
            assert np.array_equal(x, states[k]), k
            assert np.array_equal(record, records[k]), k
        else:
            np.testing.assert_allclose(x, states[k], rtol=1e-9, atol=1e-9)
        web.step()
    assert np.abs(states[-1] - states[0]).max() > 1e-3  # the loop has moved


@pytest.mark.parametrize("method", ["clamp", "damped"])
def test_singular_stacks_have_the_bits_of_the_baseline(method: str, baseline: Any) -> None:
    """The runs above end where a level has lost a direction, so that they compare the closed form of the native code."""
    name = "4R priority" if method == "clamp" else "4R damped priority"
    q, (_, law, _) = baseline[0][f"{name}/x"][-1], LOOPS[name]()
    assert law.terms(0.0, q, np.zeros(4))["ranks"] == [2, 1]
    assert any(export.startswith("step_cut") for export in WebRun(baseline[1][name]).names())


def test_a_singular_stack_without_a_closed_form_stops_the_page() -> None:
    """The method `exact` decides ranks by singular values, which a page does not have."""
    plant, law, _ = LOOPS["4R priority"]()
    for q4, is_number in ((0.7, True), (0.0, False)):
        web = WebRun(
            page_data(plant, law.replace(method="exact", eps=None), None, {"q0": [0.9, -1.2, 0.6, q4], "dt": 1e-3, "method": "rk4"})
        )
        web.step()
        assert np.isfinite(web.group("state")).all() == is_number


@pytest.mark.parametrize("name", LOOPS)
def test_poses_are_those_of_the_arm(name: str) -> None:
    web, arm = WebRun(page(name)), LOOPS[name]()[0].arm
    if arm.tip_frame is None:
        assert web.group("joints").size == 0
        return
    web.call("joints")
    web.call("frames")
    q = web.group("state")[: arm.n]
    # The programs of an arm may fuse multiply-add.
    np.testing.assert_allclose(web.group("joints").reshape(-1, 4, 4), arm.file_joint_poses(q), rtol=1e-13, atol=1e-13)
    frames = [arm.frame_names[k] for k in web.data["picture"]["frames"]]
    assert arm.tip_frame in frames
    np.testing.assert_allclose(web.group("frames").reshape(-1, 3), [arm.position(q, frame) for frame in frames], rtol=1e-13, atol=1e-13)


def test_a_control_sets_all_numbers_that_depend_on_it() -> None:
    """At each position of a slider, the page has the numbers of a loop that is built with this value."""
    plant, law, options = LOOPS["PR adaptive"]()
    options |= {"dt": 1e-3, "method": "rk4"}
    controls = {"law.kp": (10.0, 100.0), "arm.parameters[0]": (1.5, 3.0), "q0[1]": (-1.0, 1.0)}
    data = page_data(plant, law, controls, options)
    for position in (0, 37, 100):
        web = WebRun(data)
        arm, start, kp = web_loops.PR, list(options["q0"]), 40.0
        for control in data["controls"]:
            value = control["values"][position]
            numbers = np.frombuffer(b64decode(control["numbers"])).reshape(-1, len(control["slots"]))
            web.frame[control["slots"]] = numbers[position]
            if control["name"] == "law.kp":
                kp = value
            elif control["name"] == "q0[1]":
                start[1] = value
            else:
                arm = al.planar_pr(value, 0.5, 0.5)
        other = WebRun(page_data(al.RigidArm(arm), law.replace(kp=kp), None, {**options, "q0": start}))
        for _ in range(20):
            web.step()
            other.step()
        # Numbers that are 0, 1 or -1 are constants of one page, so that the signs of zeros may differ.
        assert np.array_equal(web.group("state"), other.group("state"))


KINDS = {"add": 2, "sub": 2, "mul": 2, "div": 2, "neg": 1, "fma": 3, "fnma": 3, "sqrt": 1, "abs": 1, "max": 2, "min": 2, "sin": 1, "cos": 1}


def sin_cos(x: float) -> tuple[float, float]:
    """Sine and cosine by the reduction and the polynomials of the core (fdlibm), each operation rounded."""
    rounded = x * (2.0 / math.pi) + 6755399441055744.0
    k = rounded - 6755399441055744.0
    r = x
    for part in (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21):
        r = r - k * part
    z = r * r
    zz = z * z
    s = [1.58969099521155010221e-10, -2.50507602534068634195e-8, 2.75573137070700676789e-6, -1.98412698298579493134e-4]
    s += [8.33333333332248946124e-3, -1.66666666666666324348e-1]
    c = [-1.13596475577881948265e-11, 2.08757232129817482790e-9, -2.75573143513906633035e-7, 2.48015872894767294178e-5]
    c += [-1.38888888888741095749e-3, 4.16666666666666019037e-2]

    def polynomial(a: list[float]) -> float:
        pairs = [a[i] * z + a[i + 1] for i in (0, 2, 4)]
        return (pairs[0] * zz + pairs[1]) * zz + pairs[2]

    sine, cosine = r * z * polynomial(s) + r, zz * polynomial(c) + (-0.5 * z + 1.0)
    return [(sine, cosine), (cosine, -sine), (-sine, -cosine), (-cosine, sine)][int(k) % 4]


def computed(kind: str, a: list[float]) -> float:
    match kind:
        case "add":
            return a[0] + a[1]
        case "sub":
            return a[0] - a[1]
        case "mul":
            return a[0] * a[1]
        case "div":
            return float(np.float64(a[0]) / np.float64(a[1]))
        case "neg":
            return -a[0]
        case "fma":
            return a[0] * a[1] + a[2]
        case "fnma":
            return a[2] - a[0] * a[1]
        case "sqrt":
            return math.sqrt(a[0])
        case "abs":
            return abs(a[0])
        case "max":
            return a[1] if a[0] < a[1] else a[0]
        case "min":
            return a[1] if a[1] < a[0] else a[0]
        case "sin" | "cos":
            return sin_cos(a[0])[kind == "cos"]
    raise AssertionError(kind)


def test_random_programs_have_the_bits_of_python() -> None:
    """Python computes each operation of a random program with one rounding. The outputs of some programs are also inputs."""
    chance, seen = random.Random(1), set()
    for trial in range(120):
        inputs = [chance.choice([0.0, -0.0, 1.0, chance.uniform(-3.0, 3.0)]) for _ in range(4)]
        operations: list[tuple[str, list[int]]] = [("input", [k]) for k in range(4)]
        operations += [("number", [int(np.float64(x).view(np.uint64))]) for x in (-0.0, 2.5, -1.25)]
        values, numbers, masks = [*inputs, -0.0, 2.5, -1.25], list(range(7)), []
        while len(operations) < chance.choice([20, 60, 400]):
            kind = chance.choice([*KINDS, "less", "select"])
            a = [chance.choice(numbers[-12:]) for _ in range(KINDS.get(kind, 2))]
            if kind == "less":
                masks.append(len(operations))
                values.append(values[a[0]] < values[a[1]])
            elif kind == "select":
                if not masks:
                    continue
                a = [chance.choice(masks[-3:]), *a]
                values.append(values[a[1]] if values[a[0]] else values[a[2]])
                numbers.append(len(operations))
            else:
                if (kind == "sqrt" and values[a[0]] < 0.0) or (kind == "div" and values[a[1]] == 0.0):
                    continue
                x = computed(kind, [float(values[i]) for i in a])
                if not abs(x) < 1e3:
                    continue  # NaN has no unique bits, and large angles are not reduced
                values.append(x)
                numbers.append(len(operations))
            operations.append((kind, a))
            seen.add(kind)
        # Slot 8 has the largest angle. Outputs overwrite inputs in every second trial.
        places = [0, 1, 2, 9, 10, 11] if trial % 2 else [9, 10, 11, 12, 13, 14]
        outputs = [(place, chance.choice(numbers[-10:])) for place in places]
        got = executed(_core._wasm_of_operations(operations, outputs, 8), inputs)
        for place, entry in outputs:
            assert got[place].tobytes() == np.float64(values[entry]).tobytes(), (trial, place, operations[entry])
        angles = [abs(float(values[a[0]])) for kind, a in operations if kind in ("sin", "cos")]
        assert got[8] <= max(angles, default=0.0)
    assert seen == {*KINDS, "less", "select"}


def executed(module: bytes, inputs: list[float]) -> Any:
    """The numbers of the memory after a call of the function `f`."""
    from wasmtime import Instance, Module, Store

    store = Store()
    exports: Any = Instance(store, Module(store.engine, module), []).exports(store)
    address = ctypes.cast(exports["memory"].data_ptr(store), ctypes.POINTER(ctypes.c_double))
    frame = np.ctypeslib.as_array(address, (16,))
    frame[: len(inputs)] = inputs
    exports["f"](store)
    return frame.copy()
