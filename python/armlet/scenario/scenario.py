"""A scenario: the checked tables of one closed loop, and the objects made from them.

Constructors check conditions that depend on the arm: shapes, positive definiteness, names of frames. Then the path of the key is added to
the message: `$.law.kd[1]: is not positive definite: expected > 0, got -2`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from ..arguments import file_path, instance, require_shallow
from ..border import bordered
from ..errors import InputError, ModelError, SolveError
from ..files import write_whole
from ..pickling import sealed
from ..robot_files import robot_text
from ..run.records import Run
from ..run.simulation import simulate
from .across import RIGID, across, knowing, needs_of
from .built import Built, summary
from .changes import change, entry_of, field_of, plain
from .fields import Field, Kind, OneOf
from .file import read
from .tables import SCENARIO, arguments
from .toml import toml_text

__all__ = ["Built", "Scenario", "pathed"]

MESSAGE = re.compile(r"^[\w.]+: (?P<key>[\w.\[\]]+) (?P<problem>.*?)(?: \(first bad index (?P<index>[\d, ()]+)\))?$", re.DOTALL)
#: Names that `simulate` uses in messages about joint limits, and the paths of these positions in the tables.
LIMITED = {"q0": "$.run.q0", "law.target": "$.law.target", "law.motion": "$.motion"}


@bordered
@sealed
@dataclass(frozen=True, eq=True)
class Scenario:
    """The tables of a scenario file: arm, plant, motion, law and run.

    Args:
        data: the tables; the constructor checks them.
        folder: folder to which relative paths in the tables refer.
        name: name of the scenario in messages, such as the path of its file.

    Raises:
        InputError: a key is unknown or missing, or its value is not valid; the message contains its path and the valid values.

    Source: docs/scenarios.md.

    >>> import armlet as al
    >>> law = {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0}
    >>> arm, motion = {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5}, {"kind": "Hold", "q": [1.0, 0.0]}
    >>> scenario = al.Scenario({"arm": arm, "motion": motion, "law": law, "run": {"q0": [0.0, 0.0], "t_end": 1.0, "dt": 1e-3}})
    >>> scenario.run().status
    <Status.SUCCESS: 0>
    >>> scenario.replace({"law.kd": -1.0})
    Traceback (most recent call last):
    ...
    armlet.errors.InputError: scenario: $.law.kd: expected > 0, got -1.0
    """

    data: Mapping[str, Any]
    folder: str = "."
    name: str = "scenario"

    def __post_init__(self) -> None:
        file_path("Scenario", self.folder)
        instance("Scenario", "name", self.name, str, "a text")
        _require_tables("Scenario", self.data)
        problems = list(self.problems(self.data))
        if problems:
            more = f" (and {len(problems) - 1} more: `armlet check` lists them)" if len(problems) > 1 else ""
            raise InputError(f"{self.name}: {problems[0]}{more}")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Scenario:
        """Read a scenario file (TOML).

        Args:
            path: the file. Paths in it are relative to its folder.

        Returns:
            The scenario.

        Raises:
            InputError: the file is not TOML, or is not a scenario.
            OSError: the file cannot be read.
        """
        name = file_path("Scenario.load", path)
        file = Path(name)
        return cls(read(file), str(file.parent), name)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], folder: str | PathLike[str] = ".") -> Scenario:
        """Make a scenario from a copy of its tables, with arrays converted to lists.

        Args:
            data: the tables.
            folder: folder to which relative paths in the tables refer.

        Returns:
            The scenario.
        """
        _require_tables("Scenario.from_dict", data)
        return cls(plain(data), file_path("Scenario.from_dict", folder))

    @staticmethod
    def problems(data: Mapping[str, Any]) -> Iterator[str]:
        """List the errors in tables.

        Args:
            data: the tables.

        Returns:
            One line per error, with its path. Most lines have the expected and the actual value. Errors between tables are listed only
            if each table is valid.
        """
        found = list(SCENARIO.check(data, "$"))
        yield from found
        if not found:
            yield from across(data)

    def build(self) -> Built:
        """Make the plant, the law, and the keyword arguments of `simulate`.

        Returns:
            The parts of the loop.

        Raises:
            InputError: a value does not match other values, such as a gain with a wrong shape.
            ModelError: the robot file is not well formed.
        """
        return self._build({})

    def _build(self, made: dict[Any, Any]) -> Built:
        """Build the parts like `build`. `made` stores all parts except the law, for a later scenario with equal tables."""
        parts: dict[str, Any] = {}
        tables = {"plant": RIGID} | dict(self.data)
        for table in ("arm", "model", "plant", "motion", "law"):
            if table not in tables:
                continue
            if table == "motion" and "motion" not in needs_of(tables["law"]):
                continue
            kinds = SCENARIO.keys[table]
            assert isinstance(kinds, OneOf)
            kind = kinds.kinds[tables[table]["kind"]]
            key: Any = None
            if table != "law":
                # `made` also stores the table itself, because Python may reuse the `id` of a deleted table.
                stored = made.get(id(tables[table]))
                if stored is None:
                    stored = made[id(tables[table])] = (tables[table], repr(tables[table]))
                key = (table, stored[1], *(id(parts.get(need)) for need in kind.needs))
                if key in made:
                    parts[table] = made[key]
                    continue
            values = {key: value for key, value in tables[table].items() if key != "kind"}
            if table == "law":
                values = knowing(tables["law"], tables["plant"])
            if tables[table]["kind"] == "urdf" and "path" in values and "://" not in values["path"]:
                values["path"] = str(Path(self.folder) / values["path"])
            parts[table] = pathed(self.name, table, partial(_make, kind, table, values, parts), values)
            if key is not None:
                made[key] = parts[table]
        return Built(parts["plant"], parts["law"], pathed(self.name, "run", lambda: arguments(self.data["run"]), self.data["run"]))

    def run(self, *, throw: bool = True) -> Run:
        """Build the loop and run it once, as `simulate` does.

        Args:
            throw: raise an error if the run ends early. False returns the partial run with its status.

        Returns:
            The recorded run.

        Raises:
            InputError: a value does not match other values.
            SolveError: the run ended early.
        """
        built = self.build()
        start = partial(simulate, built.plant, built.law, **built.arguments, throw=throw)
        run: Run = pathed(self.name, "run", start, self.data["run"])
        return run

    def check(self) -> None:
        """Build the loop and start it without a step, which raises the errors of invalid arguments.

        Raises:
            InputError: a value does not match other values.
        """
        built = self.build()
        short = built.arguments | {"t_end": 0.0, "t_eval": None}
        if (built.arguments.get("t_eval") is not None) and max(built.arguments["t_eval"]) > built.arguments["t_end"]:
            raise InputError(f"{self.name}: $.run.t_eval: expected times up to t_end = {built.arguments['t_end']:g}")
        pathed(self.name, "run", lambda: simulate(built.plant, built.law, **short, throw=False), self.data["run"])

    def summary(self) -> str:
        """Describe the loop in lines of text.

        Returns:
            Law, plant and duration; the joints in their order; parts of the robot that the loop ignores.
        """
        return summary(self.build(), self.data)

    def replace(self, changes: Mapping[str, Any]) -> Scenario:
        """Return a scenario with other values, by dotted path: `replace({"law.kp": 30.0, "run.q0[1]": 0.2})`.

        Args:
            changes: new values by path.

        Returns:
            The changed scenario.

        Raises:
            InputError: a path does not exist, or its new value is not valid.
        """
        instance("Scenario.replace", "changes", changes, Mapping, "values by path, such as {'law.kp': 30.0}")
        data = plain(self.data)
        for path, value in changes.items():
            change(data, path, value)
        return Scenario(data, self.folder, self.name)

    def _varied(self, changes: Mapping[str, Any]) -> Scenario:
        """Variant of `replace` for the cells of a sweep. Only changed entries of the tables are copied and checked."""
        data, entries, whole = dict(self.data), dict[tuple[str, str], Field](), False
        for path, value in changes.items():
            table, key = entry_of(path)
            if table not in self.data or (field := field_of(table, self.data[table], key)) is None:
                return self.replace(changes)
            if data[table] is self.data[table]:
                data[table] = dict(self.data[table])
            # A new key, and another inner law, may contradict other tables.
            whole = whole or key not in data[table] or key == "law"
            if (table, key) not in entries and key in data[table]:
                data[table][key] = plain(data[table][key])
            entries[table, key] = field
            change(data, path, value)
        found = (problem for (table, key), field in entries.items() for problem in field.check(data[table][key], f"$.{table}.{key}"))
        if any(found) or (whole and any(across(data))):
            return self.replace(changes)
        made = object.__new__(Scenario)
        for name, part in (("data", data), ("folder", self.folder), ("name", self.name)):
            object.__setattr__(made, name, part)
        return made

    def save(self, path: str | PathLike[str]) -> None:
        """Write the scenario as a TOML file that `load` reads. The file is complete or absent.

        Args:
            path: path of the file. A relative path of the robot file is rewritten relative to the folder of this file.

        Raises:
            OSError: the file cannot be written.

        >>> import armlet as al, tempfile
        >>> from pathlib import Path
        >>> law = {"kind": "PDGravity", "target": [0.5], "kp": 20.0, "kd": 5.0}
        >>> run = {"q0": [0.0], "t_end": 1.0, "dt": 1e-3}
        >>> scenario = al.Scenario({"arm": {"kind": "pendulum", "inertia": 1.0, "gravity_moment": 5.0}, "law": law, "run": run})
        >>> path = Path(tempfile.mkdtemp()) / "pendulum.toml"
        >>> scenario.save(path)
        >>> al.Scenario.load(path).data == scenario.data
        True
        """
        name = file_path("Scenario.save", path)
        data, folder = plain(self.data), Path(name).parent
        for table in ("arm", "model"):
            robot = data.get(table, {}).get("path")
            if robot is not None and "://" not in robot and not Path(robot).is_absolute():
                data[table]["path"] = _relative(Path(self.folder) / robot, folder)
        write_whole(Path(name), lambda file: file.write(toml_text(data).encode()))

    def standalone(self) -> Scenario:
        """Return the scenario with the text of its robot file inside.

        Returns:
            A scenario that does not depend on other files.
        """
        data = plain(self.data)
        for table in ("arm", "model"):
            path = data.get(table, {}).pop("path", None)
            if path is not None:
                file = path if "://" in path else str(Path(self.folder) / path)
                data[table]["xml"] = robot_text("Scenario.standalone", "path", file)
        return Scenario(data, self.folder, self.name)


def _relative(file: Path, folder: Path) -> str:
    """Return the path of a file relative to a folder, or its absolute path if they are on different drives."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:
        return file.resolve().as_posix()


def _require_tables(function: str, data: object) -> None:
    """Refuse data that is not a table or is nested too deeply, before recursive functions use it."""
    instance(function, "data", data, Mapping, "tables by name, such as {'arm': ..}")
    require_shallow(function, "data", data)


def _make(kind: Kind, table: str, values: Mapping[str, Any], parts: Mapping[str, Any]) -> Any:
    arm = parts["model"] if table == "law" and "model" in parts else parts.get("arm")
    needs = (*kind.needs, *(name for name in ("motion",) if table == "law" and "law" in values and name in parts))
    others = {name: arm if name == "arm" else parts[name] for name in needs}
    return kind.make(**others, **values)


def pathed(name: str, table: str, make: Callable[[], Any], values: Mapping[str, Any]) -> Any:
    """Call `make()`. Add the path of the wrong key to the messages of its errors."""
    try:
        return make()
    except ModelError as error:
        raise ModelError(f"{name}: $.{table}: {error}", error.file, error.line) from None
    except SolveError:
        raise
    except InputError as error:
        found = MESSAGE.match(str(error))
        if not found:
            raise InputError(f"{name}: $.{table}: {error}") from None
        key, index = found["key"], found["index"]
        path = f"$.{table}"
        owner = next((k for k, v in values.items() if isinstance(v, Mapping) and key in v), None)
        if key.startswith("tasks["):
            path += f".{key}"
        elif key in ("law", "plant") and table == "run":
            path = f"$.{key}"
        elif table == "run" and key.partition("[")[0] in LIMITED and "[" in key:
            whole, _, place = key.partition("[")
            path = f"{LIMITED[whole]}[{place}"
        elif owner and key not in values:
            path += f".{owner}.{key}"
        elif key in values or key in _missing(table, values):
            path += f".{key}"
        else:
            raise InputError(f"{name}: {path}: {str(error).partition(': ')[2]}") from None
        if index:
            path += "".join(f"[{part}]" for part in re.findall(r"\d+", index)) if isinstance(values.get(key), list) else ""
        raise InputError(f"{name}: {path}: {found['problem']}") from None


def _missing(table: str, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the keys that the table may have but lacks. An error of a constructor may name one of them."""
    what = SCENARIO.keys[table]
    keys: set[str] = set()
    for kind in what.kinds.values() if isinstance(what, OneOf) else [what]:
        keys |= set(getattr(kind, "keys", ()))
    return tuple(keys - set(values))
