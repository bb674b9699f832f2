"""SRDF: groups of joints of a robot and their named poses, in the format that MoveIt writes for a URDF.

    <group name="arm"><chain base_link="base" tip_link="flange"/></group>
    <group_state name="home" group="arm"><joint name="shoulder" value="0.3"/></group_state>

Source: the SRDF specification of MoveIt, https://moveit.picknik.ai/main/doc/examples/urdf_srdf/urdf_srdf_tutorial.html. A group consists
of chains, joints, links and other groups. Other elements (`disable_collisions`, end effectors, virtual and passive joints) are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._core import Arm, _urdf_joints, load_urdf, numbers
from .arguments import choice, instance, number, one_line, shown, text
from .border import border, bordered
from .errors import InputError
from .pickling import sealed
from .robot_files import robot_text

__all__ = ["Srdf", "SrdfGroup", "load_srdf"]

_Array = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True)
class SrdfGroup:
    """A group of an SRDF with its joints and links, including joints and links of the groups that it contains.

    Attributes:
        name: the name of the group.
        chains: pairs of a base link and a tip link.
        joints: names of joints.
        links: names of links; a link means the joint that moves it.
    """

    name: str
    chains: tuple[tuple[str, str], ...]
    joints: tuple[str, ...]
    links: tuple[str, ...]

    def __post_init__(self) -> None:
        text("SrdfGroup", "name", self.name)
        for name in ("chains", "joints", "links"):
            entries = instance("SrdfGroup", name, getattr(self, name), tuple, "a tuple")
            pairs = name == "chains"
            good = (isinstance(each, tuple) and len(each) == 2 and all(isinstance(end, str) for end in each) for each in entries)
            if not (all(good) if pairs else all(isinstance(each, str) for each in entries)):
                expected = "pairs of names of links" if pairs else "names"
                raise InputError(f"SrdfGroup: {name} holds something else: expected {expected}, got {shown(entries)}")


@bordered
@sealed
@dataclass(frozen=True)
class Srdf:
    """Groups and named poses of a robot, made by `load_srdf`.

    Attributes:
        name: the robot's name.
        groups: a `SrdfGroup` by name.
        states: for every pair (group, pose), the joint positions by joint name, rad or m.
    """

    name: str
    groups: Mapping[str, SrdfGroup]
    states: Mapping[tuple[str, str], Mapping[str, float]]

    def __post_init__(self) -> None:
        text("Srdf", "name", self.name)
        groups = instance("Srdf", "groups", self.groups, Mapping, "groups by name")
        if not all(isinstance(group, SrdfGroup) and name == group.name for name, group in groups.items()):
            raise InputError(f"Srdf: groups holds something else: expected a SrdfGroup for each name, got {shown(groups)}")
        for place, values in instance("Srdf", "states", self.states, Mapping, "poses by group and name").items():
            known = isinstance(place, tuple) and len(place) == 2 and place[0] in groups and isinstance(place[1], str)
            if not known or not isinstance(values, Mapping) or not all(isinstance(joint, str) for joint in values):
                expected = "positions by joint for pairs of a group and a pose"
                raise InputError(f"Srdf: states holds something else: expected {expected}, got {shown(place)}")
            for joint, value in values.items():
                number("Srdf", f"states[{shown(place)}][{shown(joint)}]", value)

    def arm(self, source: str | PathLike[str], group: str, **keywords: Any) -> Arm:
        """Make the arm of a group: the chain between two links of the robot.

        Args:
            source: the robot's URDF, a path or its text, as for `load_urdf`.
            group: name of the group. It must be one chain, or joints or links that form one chain.
            keywords: keyword arguments of `load_urdf`, except `root` and `tip`.

        Returns:
            The arm between the two links.

        Raises:
            InputError: the group is unknown or is not one chain, `root` or `tip` is given, or the file cannot be read.
            ModelError: the URDF is not well formed.
        """
        name = "Srdf.arm"
        choice(name, "group", group, self.groups)
        for key in ("root", "tip"):
            if key in keywords:
                raise InputError(f"{name}: {key} is not used: expected the keywords of load_urdf without root and tip")
        files = {key: keywords.get(key) for key in ("search_path", "xacro_arguments")}
        root, tip = self._ends(source, self.groups[group], files)
        return load_urdf(source, root=root, tip=tip, **keywords)

    def pose(self, arm: Arm, state: str, *, group: str | None = None, otherwise: ArrayLike = 0.0) -> _Array:
        """Return a named pose as joint positions `q` of an arm, `(n,)`, rad or m.

        Args:
            arm: an arm of this robot.
            state: name of the pose.
            group: the group of the pose; None: the only group with a pose of this name (keyword only).
            otherwise: positions of joints that the pose does not name, a number or `(n,)`, rad or m (keyword only).

        Returns:
            The joint positions `(n,)`, rad or m.

        Raises:
            InputError: the pose is unknown, or none of its joints is in the arm.
        """
        name = "Srdf.pose"
        instance(name, "arm", arm, Arm, "an Arm")
        text(name, "state", state)
        owners = [owner for owner, known in self.states if known == state]
        if not owners:
            choice(name, "state", state, dict.fromkeys(known for _, known in self.states))
        if group is None and len(owners) > 1:
            raise InputError(f"{name}: group is missing: expected one of {', '.join(owners)}, which have a pose {shown(state)}")
        owner = owners[0] if group is None else choice(name, "group", group, owners)
        values = self.states[owner, state]
        q = np.array(np.broadcast_to(_numbers(name, otherwise, arm.n), (arm.n,)))
        own = [i for i, joint in enumerate(arm.joint_names) if joint in values]
        if not own:
            raise InputError(f"{name}: arm has no joint of the pose: expected one of {', '.join(values)}, got {', '.join(arm.joint_names)}")
        for i in own:
            q[i] = values[arm.joint_names[i]]
        return q

    def _ends(self, source: object, group: SrdfGroup, files: Mapping[str, Any]) -> tuple[str, str]:
        """The base link and the tip link of the chain that a group forms."""
        name = "Srdf.arm"
        if len(group.chains) == 1 and not group.joints and not group.links:
            return group.chains[0]
        carried = {child: (joint, parent) for joint, parent, child in _urdf_joints(name, robot_text(name, "source", source, **files))}
        child_of = {joint: child for child, (joint, _) in carried.items()}
        listed = [child_of[joint] for joint in group.joints if joint in child_of] + [link for link in group.links if link in carried]
        for base, tip in group.chains:
            listed += _between(carried, base, tip)
        links = dict.fromkeys(listed)
        # The joints form one chain if exactly one link has its parent outside, exactly one has no child, and no two have the same parent.
        first = [link for link in links if carried[link][1] not in links]
        last = [link for link in links if all(carried[other][1] != link for other in links)]
        if len(first) != 1 or len(last) != 1 or len({carried[link][1] for link in links}) < len(links):
            what = ", ".join(carried[link][0] for link in links) or "none of them"
            raise InputError(f"{name}: group {group.name} is not one chain: expected joints one after another, got {what}")
        return carried[first[0]][1], last[0]


def _between(carried: Mapping[str, tuple[str, str]], base: str, tip: str) -> list[str]:
    """The links of a chain from its tip to its base, without the base."""
    links: list[str] = []
    at = tip
    while at != base and at in carried and len(links) <= len(carried):
        links.append(at)
        at = carried[at][1]
    if at != base:
        raise InputError(f"Srdf.arm: group has a chain that is not in the robot: expected a path of links from {base} to {tip}")
    return links


def _numbers(function: str, value: ArrayLike, n: int) -> _Array:
    values: _Array = numbers(function, "otherwise", value, (), (n,))
    if not np.isfinite(values).all():
        raise InputError(f"{function}: otherwise is not finite: expected finite numbers, got {shown(value)}")
    return values


def _tree(function: str, xml: str) -> ElementTree.Element:
    """Parse the XML of an SRDF and return its root element. Refuse text that declares a document type or entities."""
    if "<!DOCTYPE" in xml or "<!ENTITY" in xml:
        raise InputError(f"{function}: source declares a document type: expected XML without one")
    # The parser takes a text with zero characters for UTF-16, and would then find a document type that the search above does not.
    if "\0" in xml:
        raise InputError(f"{function}: source is not well formed: expected no zero character")
    try:
        tree = ElementTree.fromstring(xml)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{function}: source is not well formed: {one_line(str(error))}") from None
    if tree.tag != "robot":
        raise InputError(f"{function}: source has the wrong root: expected <robot>, got <{one_line(tree.tag)[:80]}>")
    return tree


@border
def load_srdf(path_or_xml: str | PathLike[str]) -> Srdf:
    """Read groups and named poses from an SRDF file, or from its text.

    Args:
        path_or_xml: a path, `package://name/file`, or the XML text.

    Returns:
        An `Srdf` with the groups and the poses, rad or m.

    Raises:
        InputError: the file cannot be read, is not well formed, defines a group twice, or refers to an unknown group. It is also raised if
            a name is missing, or a value is not a finite number.

    Source: the SRDF specification of MoveIt.

    >>> import armlet as al
    >>> srdf = al.load_srdf('''<robot name="planar_2r">
    ...   <group name="arm"><chain base_link="base" tip_link="tool"/></group>
    ...   <group_state name="bent" group="arm"><joint name="joint2" value="1.2"/></group_state>
    ... </robot>''')
    >>> arm = srdf.arm(al.example_urdf("planar_2r"), "arm")
    >>> srdf.pose(arm, "bent")
    array([0. , 1.2])
    """
    function = "load_srdf"
    tree = _tree(function, robot_text(function, "path_or_xml", path_or_xml))
    elements: dict[str, ElementTree.Element] = {}
    for element in tree.findall("group"):
        name = _attribute(function, element, "name")
        if name in elements:
            raise InputError(f"{function}: path_or_xml names a group twice: expected distinct names, got {shown(name)} again")
        elements[name] = element
    groups = {name: _group(function, name, elements) for name in elements}
    states: dict[tuple[str, str], Mapping[str, float]] = {}
    for element in tree.findall("group_state"):
        owner, name = _attribute(function, element, "group"), _attribute(function, element, "name")
        if owner not in groups:
            known = ", ".join(groups) or "none"
            raise InputError(f"{function}: path_or_xml has a pose {shown(name)} of an unknown group: expected {known}, got {shown(owner)}")
        values = {_attribute(function, joint, "name"): _value(function, name, joint) for joint in element.findall("joint")}
        states[owner, name] = values
    return Srdf(tree.get("name", ""), groups, states)


def _attribute(function: str, element: ElementTree.Element, name: str) -> str:
    value = element.get(name)
    if not value:
        raise InputError(f"{function}: path_or_xml has a <{element.tag}> without {name}: expected a name, got {shown(value)}")
    return value


def _value(function: str, state: str, joint: ElementTree.Element) -> float:
    """The position of a joint with one coordinate, rad or m."""
    given = joint.get("value", "")
    try:
        value = float(given)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        place = f"joint {shown(joint.get('name'))} of pose {shown(state)}"
        raise InputError(f"{function}: path_or_xml has a value that is no number: expected one, got {shown(given)} ({place})")
    return value


def _group(function: str, name: str, elements: Mapping[str, ElementTree.Element]) -> SrdfGroup:
    """Make a group, including the content of the groups that it contains."""
    chains: dict[tuple[str, str], None] = {}
    parts: dict[str, dict[str, None]] = {"joint": {}, "link": {}}
    seen: set[str] = set()
    due: list[str] = [name]
    while due:
        at = due.pop()
        if at in seen:
            continue
        seen.add(at)
        if at not in elements:
            known = ", ".join(elements)
            raise InputError(f"{function}: path_or_xml has an unknown group in group {shown(name)}: expected {known}, got {shown(at)}")
        for element in elements[at]:
            if element.tag == "chain":
                chains[_attribute(function, element, "base_link"), _attribute(function, element, "tip_link")] = None
            elif element.tag in parts:
                parts[element.tag][_attribute(function, element, "name")] = None
            elif element.tag == "group":
                due.append(_attribute(function, element, "name"))
    return SrdfGroup(name, tuple(chains), tuple(parts["joint"]), tuple(parts["link"]))
