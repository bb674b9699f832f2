"""The command `armlet fit`: the parameters of an arm or of a scenario from a log, and the assumptions that the log refutes."""

from __future__ import annotations

import argparse
from pathlib import Path

from .. import _core
from ..arguments import one_line
from ..errors import InputError
from ..fitting import fit_log
from ..logs import read_log
from ..scenario import Scenario

__all__ = ["register"]

#: The default gravity of a robot file, m/s^2.
GRAVITY = (0.0, 0.0, -9.81)


def _fit(args: argparse.Namespace) -> int:
    scenario = None if args.scenario is None else Scenario.load(args.scenario)
    if scenario is not None and args.gravity is not None:
        raise InputError("--gravity belongs to --urdf: expected the gravity in the scenario's file")
    arm = _core.load_urdf(args.urdf, gravity=tuple(args.gravity or GRAVITY)) if scenario is None else scenario.build().plant.arm
    log = read_log(args.log, arm=arm)
    names = tuple(name.strip() for name in args.names.split(","))
    given = {} if args.stribeck_speed is None else {"stribeck_speed": args.stribeck_speed}
    fit = fit_log(arm if scenario is None else scenario, log, names, cutoff=args.cutoff, delay=args.delay, **given)
    for line in [*str(log.report).splitlines(), *str(fit).splitlines()]:
        print(one_line(line) if not line.startswith("  ") else f"  {one_line(line)}")
    if args.report is not None:
        fit.report(args.report, title=f"Fit of {args.log.name}")
        print(f"wrote {args.report}")
    return 1 if fit.refuted else 0


def register(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command of this file to `commands`."""
    fit = commands.add_parser(
        "fit", help="fit the arm of a robot file or a scenario to a log; exit code 1 if the log refutes an assumption"
    )
    fit.add_argument("log", type=Path, metavar="LOG.csv")
    model = fit.add_mutually_exclusive_group(required=True)
    model.add_argument("--urdf", type=Path, metavar="ROBOT.urdf", help="the robot; its joints select the columns of the log")
    loop = "the loop; its plant predicts the positions, and its law computes the torques of a log without torques"
    model.add_argument("--scenario", type=Path, metavar="LOOP.toml", help=loop)
    gravity = "gravity in the axes of the robot's base, m/s^2 (default: 0 0 -9.81)"
    fit.add_argument("--gravity", type=float, nargs=3, metavar=("X", "Y", "Z"), help=gravity)
    fit.add_argument(
        "--names",
        default="inertia,rotors,viscous,coulomb,offsets",
        metavar="KIND,KIND",
        help="kinds of parameters, as those of al.fit_log (default: inertia, rotors, viscous, coulomb, offsets)",
    )
    fit.add_argument("--cutoff", type=float, metavar="HZ", help="cutoff of the filter (default: 10 Hz, or a tenth of the sample rate)")
    late = "time from the record of a torque to its effect (default: that of the scenario, or 0)"
    fit.add_argument("--delay", type=float, metavar="S", help=late)
    fit.add_argument("--stribeck-speed", type=float, metavar="V", help="speed of Stribeck friction, rad/s or m/s (default: 0.1)")
    fit.add_argument("--report", type=Path, metavar="FILE.html", help="write a report")
    fit.set_defaults(run=_fit)
