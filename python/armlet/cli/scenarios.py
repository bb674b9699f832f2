"""Commands for scenario files (`armlet run`, `check`, `export`, `web`, `new`, `sweep`, `worst`, `schema`), and `view`, `lab`."""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..arguments import one_line, shown
from ..errors import InputError
from ..figures.style import literal, require
from ..files import folder_for, write_whole
from ..run.records import Run
from ..run.sensitivity import series_of
from ..scenario import TEMPLATES, Scenario, schema, template
from ..scenario.file import read
from ..sweeping.execution import cells_of, rehearse, sweep
from ..sweeping.worst import worst_case

__all__ = ["register"]


def _run(args: argparse.Namespace) -> int:
    scenario = Scenario.load(args.scenario)
    _prepare(args)
    with _warnings_on_lines():
        run = scenario.run()
    print(one_line(scenario.data.get("title", args.scenario.stem)))
    print(run)
    metrics = run.metrics()
    print(metrics)
    if metrics["monitor_violations"]:
        print("  (monitors above the tolerance 1e-6: a shorter dt or an adaptive method reduces the part that the integrator causes)")
    for name, one in (run.sensitivity or {}).items():
        largest = ", ".join(f"{series} {np.abs(values).max():.4g}" for series, values in series_of(one).items())
        print(one_line(f"derivatives by {name}, largest: {largest}"))
    for path in _results(run, scenario, args):
        print(f"wrote {path}")
    return 0


@contextmanager
def _warnings_on_lines() -> Iterator[None]:
    """Print each warning as one line."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            for warning in warned:
                print(one_line(f"armlet: warning: {warning.message}"), file=sys.stderr)


def _prepare(args: argparse.Namespace) -> None:
    """Make the folder of the output and check that it is writable, before the run starts."""
    if args.plot:
        require(f"{args.command}: --plot")
    if args.out is not None or args.plot or args.report:
        folder_for(args.out or Path())


def _results(run: Run, scenario: Scenario, args: argparse.Namespace) -> list[Path]:
    stem = (args.out or Path()) / args.scenario.stem
    written = []
    if args.out is not None:
        run.save(stem.with_suffix(".npz"))
        run.to_csv(stem.with_suffix(".csv"))
        written += [stem.with_suffix(".npz"), stem.with_suffix(".csv")]
    if args.report:
        written.append(_report_file(run, scenario, stem.with_suffix(".html")))
    if args.plot:
        from matplotlib.figure import Figure

        written.append(_figure_file(run, scenario, stem.with_suffix(".png")))
        for name, one in (run.sensitivity or {}).items():
            figure = Figure()
            one.plot(figure)
            path = stem.with_name(f"{stem.name}.{name}.png")
            write_whole(path, partial(figure.savefig, dpi=150, format="png"))
            written.append(path)
    return written


def _report_file(run: Run, scenario: Scenario, path: Path) -> Path:
    """Write the report of a run of the scenario, and return its path."""
    run.report(path, title=scenario.data.get("title", path.stem), inputs=scenario.data)
    return path


def _figure_file(run: Run, scenario: Scenario, path: Path) -> Path:
    """Write the figure of a run of the scenario, and return its path."""
    from matplotlib.figure import Figure

    figure = Figure()
    run.plot(figure)
    figure.suptitle(literal(scenario.data.get("title", "")), usetex=False)
    write_whole(path, lambda file: figure.savefig(file, dpi=150, format="png"))
    return path


def _check(args: argparse.Namespace) -> int:
    if args.scenario.suffix.lower() in (".urdf", ".xacro", ".xml"):
        return _check_robot(args.scenario)
    problems, cells = list(Scenario.problems(read(args.scenario))), 0
    if not problems:
        scenario = Scenario.load(args.scenario)
        try:
            with _warnings_on_lines():
                scenario.check()
            if "sweep" in scenario.data:
                planned = cells_of(scenario)
                cells = len(planned)
                rehearse(scenario, planned)
        except InputError as error:
            problems = [str(error).removeprefix(f"{args.scenario}: ")]
    for problem in problems:
        print(one_line(f"{args.scenario}: {problem}"), file=sys.stderr)
    if not problems:
        first, *more = scenario.summary().splitlines()
        print(f"{args.scenario}: is a scenario: {first}" + (f"; a sweep of {cells} runs" if cells else ""))
        for line in more:
            print(f"  {one_line(line)}")
    return 2 if problems else 0


def _check_robot(path: Path) -> int:
    arm = _core.load_urdf(path)
    print(arm)
    print(one_line(f"frames: {', '.join(arm.frame_names)}"))
    for line in arm.report:
        print(one_line(line))
    return 0


def _export(args: argparse.Namespace) -> int:
    from ..printed import export_c

    built = Scenario.load(args.scenario).build()
    chosen: dict[str, Any] = {"prefix": args.prefix, "overwrite": args.overwrite}
    if args.functions is not None:
        functions = [tuple(name.split(":", 1)) if ":" in name else name for name in args.functions.split(",")]
        files = export_c(built.plant.arm, args.out, functions=functions, **chosen)
    else:
        method, dt = built.arguments.get("method", "rk4"), built.arguments.get("dt")
        own: dict[str, Any] = {"tau_max": built.arguments.get("tau_max")}
        # `export_c` integrates the state of a law only with these three methods.
        if built.law._state_count and method in ("euler", "semi_implicit", "rk4"):
            own |= {"method": method, "dt": dt}
        if isinstance(built.law, _core.Guarded):
            sampling = built.arguments.get("sample_time")
            own["sample_time"] = getattr(sampling, "period", sampling)
        files = export_c(built.law, args.out, **own, **chosen)
    for file in files:
        print(f"wrote {file}")
    return 0


def _web(args: argparse.Namespace) -> int:
    from ..web import export_web

    controls = {name: (_number(name, low), _number(name, high)) for name, low, high in args.control}
    path = export_web(Scenario.load(args.scenario), args.out or args.scenario.with_suffix(".html").name, controls)
    print(f"wrote {path}")
    return 0


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"web: --control {name} has a limit that is no number: expected a number, got {shown(text)}") from None


def _new(args: argparse.Namespace) -> int:
    sys.stdout.write(template(args.template))
    return 0


def _schema(args: argparse.Namespace) -> int:
    print(json.dumps(schema(), indent=1))
    return 0


def _sweep(args: argparse.Namespace) -> int:
    scenario = Scenario.load(args.scenario)
    if "sweep" not in scenario.data:
        raise InputError(f"{args.scenario}: $.sweep: is missing: expected a table with the keys vary, draws, seed, chunk")
    if args.plot:
        require("sweep: --plot")
    given: dict[str, Any] = {"out": args.out, "progress": sys.stderr.isatty()}
    if args.workers is None:
        table = sweep(scenario, **given)
    else:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        # "spawn" instead of "fork" gives every worker process a clean start on all platforms.
        with ProcessPoolExecutor(args.workers, mp_context=get_context("spawn")) as pool:
            table = sweep(scenario, **given, executor=pool)
    print(table)
    print(f"wrote {table.to_csv(args.out / 'table.csv')}")
    if args.plot:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 4.6), layout="constrained")
        table.plot(fig=figure)
        write_whole(args.out / "table.png", lambda file: figure.savefig(file, dpi=150, format="png"))
        print(f"wrote {args.out / 'table.png'}")
    return 0


def _worst(args: argparse.Namespace) -> int:
    scenario = Scenario.load(args.scenario)
    if "worst" not in scenario.data:
        raise InputError(f"{args.scenario}: $.worst: is missing: expected a table with the keys vary, criterion, runs, starts, seed")
    _prepare(args)
    found = worst_case(scenario, progress=sys.stderr.isatty())
    print(found)
    stem = (args.out or Path()) / f"{args.scenario.stem}.worst"
    written = []
    if args.out is not None:
        path = stem.with_name(f"{stem.name}.toml")
        found.scenario.save(path)
        written = [path, found.tried.to_csv(stem.with_name(f"{stem.name}.csv"))]
    if args.report:
        written.append(_report_file(found.run, found.scenario, stem.with_name(f"{stem.name}.html")))
    if args.plot:
        written.append(_figure_file(found.run, scenario, stem.with_name(f"{stem.name}.png")))
    for path in written:
        print(f"wrote {path}")
    return 0


def _resume(args: argparse.Namespace) -> str:
    """The advice after an interruption of a sweep."""
    return f": finished chunks are in {args.out}; the same command continues the sweep"


def _view(args: argparse.Namespace) -> int:
    from ..live.view import view

    return view(args.urdf, args.host, args.port, args.package)


def _lab(args: argparse.Namespace) -> int:
    from ..live.lab import lab

    return lab(args.urdf, args.frame, args.host, args.port, args.package)


# Largest number of worker processes of a sweep.
MOST_WORKERS = 1024


def _workers(text: str) -> int:
    # The length is checked first, because Python refuses to convert very long integers.
    if not (text.isascii() and text.isdecimal()) or len(text) > 9 or not 1 <= int(text) <= MOST_WORKERS:
        raise argparse.ArgumentTypeError(f"expected an integer from 1 to {MOST_WORKERS}, got {shown(text)}")
    return int(text)


def _register_exports(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands that write C code or web pages to `commands`."""
    export = commands.add_parser("export", help="write the law of a scenario, or functions of its arm, as C code")
    export.add_argument("scenario", type=Path, metavar="FILE.toml")
    export.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the header, the source file and CMakeLists.txt")
    export.add_argument(
        "--functions",
        metavar="NAME,NAME:FRAME",
        help="export these functions of the arm instead of the law, for example mass_matrix,jacobian:flange",
    )
    export.add_argument("--prefix", metavar="NAME", help="prefix of all names in C (default: law, or arm)")
    export.add_argument("--overwrite", action="store_true", help="overwrite files that armlet did not write")
    export.set_defaults(run=_export)

    web = commands.add_parser("web", help="write a web page that runs the loop of a scenario in the browser")
    web.add_argument("scenario", type=Path, metavar="FILE.toml")
    web.add_argument("--out", type=Path, metavar="PAGE.html", help="path of the page (default: the name of the scenario, here)")
    web.add_argument(
        "--control",
        nargs=3,
        action="append",
        default=[],
        metavar=("NAME", "LOW", "HIGH"),
        help="a slider for a number, for example law.kp 10 100; may be repeated",
    )
    web.set_defaults(run=_web)


def register(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands of this file to `commands`."""
    run = commands.add_parser("run", help="run a scenario file; print its metrics")
    run.add_argument("scenario", type=Path, metavar="FILE.toml")
    run.add_argument("--out", type=Path, metavar="DIR", help="folder for the run (npz), its table (csv) and its figure")
    run.add_argument("--plot", action="store_true", help="write a figure into DIR, or into the current folder")
    run.add_argument("--report", action="store_true", help="write a report (HTML) into DIR, or into the current folder")
    run.set_defaults(run=_run, command="run")

    check = commands.add_parser(
        "check", help="report errors of a scenario file without running it; list the joints and frames of a robot file"
    )
    check.add_argument("scenario", type=Path, metavar="FILE.toml|ROBOT.urdf")
    check.set_defaults(run=_check)

    _register_exports(commands)

    new = commands.add_parser("new", help="print an example of a scenario file with comments")
    new.add_argument("template", choices=TEMPLATES)
    new.set_defaults(run=_new)

    sweep = commands.add_parser(
        "sweep", help="run a scenario for each combination of values in its table [sweep]; continue an interrupted sweep"
    )
    sweep.add_argument("scenario", type=Path, metavar="FILE.toml")
    sweep.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    sweep.add_argument("--plot", action="store_true", help="write a figure of the first metric over the varied values into DIR")
    sweep.add_argument(
        "--workers", type=_workers, metavar="N", help="number of worker processes (default: none, the sweep uses threads of this process)"
    )
    sweep.set_defaults(run=_sweep, resume=_resume)

    worst = commands.add_parser("worst", help="search for the worst case of a scenario file over the box of its table [worst]")
    worst.add_argument("scenario", type=Path, metavar="FILE.toml")
    worst.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the worst scenario (toml), the table of all runs (csv) and the figure"
    )
    worst.add_argument("--plot", action="store_true", help="write a figure of the worst run into DIR, or into the current folder")
    worst.add_argument("--report", action="store_true", help="write a report (HTML) of the worst run into DIR, or into the current folder")
    worst.set_defaults(run=_worst, command="worst")

    schema = commands.add_parser("schema", help="print the JSON schema of scenario files, which editors use to complete and check them")
    schema.set_defaults(run=_schema)

    view = commands.add_parser("view", help="show a robot in the browser, with one slider per joint")
    view.add_argument("urdf", type=Path, metavar="ROBOT.urdf")
    view.set_defaults(run=_view)

    lab = commands.add_parser("lab", help="simulate control loops in the browser, with controls for gains, targets and forces")
    lab.add_argument("--urdf", type=Path, metavar="ROBOT.urdf", help="robot file that is added to the list of systems")
    lab.add_argument(
        "--frame", metavar="NAME", help="frame of the robot's tip (default: the moving frame with the longest path from the base)"
    )
    lab.set_defaults(run=_lab)

    for page in (view, lab):
        page.add_argument(
            "--package", type=Path, action="append", default=[], metavar="DIR", help="another folder with meshes; may be repeated"
        )
        page.add_argument("--host", default="127.0.0.1", help="address of the server (default: 127.0.0.1, only this machine)")
        page.add_argument("--port", type=int, default=8080, help="port of the server, 0 for a free port (default: 8080)")
