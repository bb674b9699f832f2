"""The labels of sliders: what a named number of a loop is, in the words of its field, and its unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

__all__ = ["labelled"]

#: Units of numbers of a joint that turns, and of one that slides.
POSITION, SPEED, FORCE = ("rad", "m"), ("rad/s", "m/s"), ("N m", "N")
SPRING, DAMPER, INTEGRAL, INERTIA = ("N m/rad", "N/m"), ("N m s/rad", "N s/m"), ("N m/(rad s)", "N/(m s)"), ("kg m²", "kg")
NO_UNIT, PER_SECOND, PER_SECOND_2 = ("", ""), ("1/s", "1/s"), ("1/s²", "1/s²")

START = {
    "q0": ("initial position", POSITION),
    "v0": ("initial velocity", SPEED),
    "theta0": ("initial motor position", POSITION),
    "theta_dot0": ("initial motor velocity", SPEED),
}
#: The ten inertial parameters of a link, and those of `planar_pr`.
LINK = (
    ("mass", "kg"),
    *((f"first moment m c_{axis}", "kg m") for axis in "xyz"),
    *((f"inertia I_{axes}", "kg m²") for axes in ("xx", "xy", "yy", "xz", "yz", "zz")),
)
PLANAR_PR = (("mass A", "kg"), ("first moment B", "kg m"), ("inertia C", "kg m²"))
DRIVES = {"damping": ("viscous damping", DAMPER), "friction": ("Coulomb friction", FORCE), "armature": ("rotor inertia", INERTIA)}
#: Arguments of laws, and of plants with their friction.
LAW = {
    "kp": ("position gain", SPRING),
    "kd": ("velocity gain", DAMPER),
    "ki": ("integral gain", INTEGRAL),
    "kt": ("gain of the joint torque", NO_UNIT),
    "ks": ("gain of the joint torque's rate", ("s", "s")),
    "gamma": ("adaptation gain", NO_UNIT),
    "stiffness": ("stiffness", SPRING),
    "damping": ("damping", DAMPER),
    "integral_gain": ("integral gain", INTEGRAL),
    "target": ("target", POSITION),
    "joint_stiffness": ("joint stiffness in the law", SPRING),
    "motor_inertia": ("motor inertia in the law", INERTIA),
    "reduced_inertia": ("reduced motor inertia", INERTIA),
    "motor_damping": ("damping of the motor loop", DAMPER),
    "damping_ratio": ("damping ratio of the motor loop", NO_UNIT),
    "derivative_filter": ("bandwidth of the velocity filter", PER_SECOND),
    "observer_bandwidth": ("bandwidth of the disturbance observer", PER_SECOND),
    "eps": ("smallest singular value, eps", NO_UNIT),
    "nullspace.stiffness": ("stiffness of the posture", SPRING),
    "nullspace.damping": ("damping of the posture", DAMPER),
}
PLANT = {
    "stiffness": ("joint stiffness", SPRING),
    "motor_inertia": ("motor inertia", INERTIA),
    "joint_damping": ("joint damping", DAMPER),
    "motor_friction": ("viscous friction of the motor", DAMPER),
}
FRICTION = {
    "coulomb": ("Coulomb friction", FORCE),
    "static": ("static friction", FORCE),
    "stribeck_speed": ("Stribeck speed", SPEED),
    "viscous": ("viscous friction", DAMPER),
    "load_ratio": ("friction per load", NO_UNIT),
    "stiffness": ("bristle stiffness", SPRING),
    "damping": ("bristle damping", DAMPER),
}
#: Laws with a part in coordinates of a frame.
CARTESIAN = ("stiffness", "damping", "integral_gain", "target")


def labelled(plant: Any, law: Any, base: str, index: tuple[int, ...] | None) -> tuple[str, str]:
    """Return the label and the unit of the number `base`, or of its entry `index`. The label is empty for an unknown number."""
    arm = re.fullmatch(r"(law\.)?arm\.(\w+)", base)
    if arm:
        label, unit = _of_arm(plant if arm[1] is None else law, arm[2], index)
        return (label + " in the law's model" if arm[1] and label else label), unit
    arguments = law.__getnewargs_ex__()[1]
    task = re.fullmatch(r"law\.tasks\.(\d+)\.(gain|damping)", base)
    if task:
        unit = "1/s²" if task[2] == "gain" and type(law).__name__ == "PriorityAcceleration" else "1/s"
        return f"{task[2]} of task {int(task[1]) + 1}" + _entry(index), unit
    known = _known(base)
    if known is None:
        return "", ""
    (label, units), name = known, base.removeprefix("law.")
    if name == "gamma":
        parameters = law.parameter_names
        return label + (f" of {parameters[index[0]]}" if index and len(index) == 1 else _entry(index)), ""
    if base.startswith("law.") and "frame" in arguments and name in CARTESIAN:
        axes = re.findall("r?[xyz]", arguments.get("axes") or "xyz")
        unit = _unit(units, [len(axis) == 1 for axis in (axes if index is None else [axes[i] for i in index])])
        return label + (f" along {axes[index[0]]}" if index and len(index) == 1 else _entry(index)), unit
    if name in ("kp", "kd") and type(law).__name__ == "ComputedTorque":
        units = PER_SECOND_2 if name == "kp" else PER_SECOND
    slides = [kind == "prismatic" for kind in plant.arm.joint_types]
    if index is not None:
        slides = [slides[i] for i in index]
    names = plant.arm.joint_names
    return label + (f" of {names[index[0]]}" if index and len(index) == 1 else _entry(index)), _unit(units, slides)


def _known(base: str) -> tuple[str, tuple[str, str]] | None:
    place, _, name = base.partition(".")
    if not name:
        return START.get(place)
    if place == "law":
        return LAW.get(name)
    friction = re.fullmatch(r"(?:motor_)?friction\.(\w+)", name)
    return FRICTION.get(friction[1]) if friction else PLANT.get(name)


def _of_arm(owner: Any, name: str, index: tuple[int, ...] | None) -> tuple[str, str]:
    arm = owner.arm if hasattr(owner, "arm") else owner.__getnewargs_ex__()[1]["arm"]
    if name == "parameters" and index is not None:
        if arm.tip_frame is None:
            return PLANAR_PR[index[0]]
        label, unit = LINK[index[0] % 10]
        return f"{label} of link {index[0] // 10 + 1}", unit
    if name not in DRIVES:
        return "", ""
    (label, units), slides = DRIVES[name], [kind == "prismatic" for kind in arm.joint_types]
    return label + (f" of {arm.joint_names[index[0]]}" if index else ""), _unit(units, slides if index is None else [slides[index[0]]])


def _entry(index: tuple[int, ...] | None) -> str:
    return "" if index is None else f" [{', '.join(str(i) for i in index)}]"


def _unit(units: tuple[str, str], slides: Sequence[bool]) -> str:
    """The unit of numbers of joints of which some slide; empty if the units differ."""
    return units[slides[0]] if all(units[each] == units[slides[0]] for each in slides) else ""
