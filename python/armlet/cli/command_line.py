"""The command line: `armlet demo`, `armlet info`, and the commands for scenario files (`scenarios.py`) and logs (`logs.py`).

Each command is a function that takes the parsed arguments and returns the exit code. 0: success. 1: a check failed, or the program that
reads the output has ended. 2: the command could not run; standard error states the reason. 130: interrupted by the user.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from .. import _core
from ..arguments import one_line
from ..errors import ArmletError
from ..extras import missing
from ..figures.style import available
from ..reports.page import versions
from . import logs, scenarios

__all__ = ["main"]


def _demo(args: argparse.Namespace) -> int:
    from ..demo import demonstrate

    figures = available()
    report = demonstrate(args.out, figures=figures)
    print(f"\nreport: {report.out / 'report.html'}")
    if figures:
        print("figures: " + " ".join(str(path) for path in report.figures))
    else:
        print(missing("figures skipped", "matplotlib", "plot"))
    failed = report.failed
    print(f"{len(report.checks) - len(failed)} of {len(report.checks)} checks hold" + (f"; {len(failed)} FAILED" if failed else ""))
    return 1 if failed or not report.checks else 0


def _info(args: argparse.Namespace) -> int:
    rows = versions()
    width = max(map(len, rows))
    for name, value in rows.items():
        print(f"{name:<{width}}  {value}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="armlet", description="Simulate control loops of robot arms.")
    parser.add_argument("--version", action="version", version=f"armlet {_core.__version__}")
    commands = parser.add_subparsers(title="commands", metavar="command", required=True)

    demo = commands.add_parser("demo", help="run the four demonstration systems: print a table of checks, write a report and figures")
    demo.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="folder for the report and the figures (default: ./out)")
    demo.set_defaults(run=_demo)

    info = commands.add_parser("info", help="print the version, the instruction set and the number of threads")
    info.set_defaults(run=_info)

    scenarios.register(commands)
    logs.register(commands)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line with the arguments `argv` and return the exit code. None: the arguments of the process."""
    if sys.stdout is None:
        # The calling program has closed standard output, so output is discarded.
        sys.stdout = io.StringIO()
    parser = _parser()
    if not (sys.argv[1:] if argv is None else argv):
        parser.print_help(sys.stderr)
        parser.exit(2)
    args = parser.parse_args(argv)
    try:
        code: int = args.run(args)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print(f"armlet: interrupted{args.resume(args) if 'resume' in args else ''}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reading program (head, less) has ended. The rest of the output is discarded.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ArmletError, OSError, MemoryError, ImportError) as error:
        print(f"armlet: {_line(error)}", file=sys.stderr)
        return 2
    except Exception as error:
        # This is a bug of armlet. One line with the type of the error is sufficient for a report.
        print(f"armlet: internal error, please report it: {type(error).__name__}: {_line(error)}", file=sys.stderr)
        return 2


def _line(error: BaseException) -> str:
    """Return an error as one line. For an error of the operating system, the line names the file and the problem."""
    if isinstance(error, OSError) and error.strerror:
        return one_line((f"{error.filename}: " if error.filename else "output: ") + error.strerror.lower())
    return one_line(str(error)) or type(error).__name__
