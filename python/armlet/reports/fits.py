"""The report of a fit: `fit.report(path)`."""

from __future__ import annotations

from html import escape
from os import PathLike
from typing import Any

from ..figures.log import plot_fit
from .page import figure_section, section, table, write_report

__all__ = ["write_fit"]


def write_fit(fit: Any, path: str | PathLike[str], title: str | None) -> None:
    """Write the report of a fit. `title` is the heading, None for a heading with the joints."""
    heading = title if title is not None else f"Fit of a log, {len(fit.joints)} joint{'s' * (len(fit.joints) > 1)}"
    count = len(fit.refuted)
    verdict = "no assumption is refuted" if not count else f"{count} refuted assumption{'s' * (count > 1)}"
    body = [
        f'<p class="{"FAILED" if count else "ok"}">{escape(verdict)}</p>',
        _refuted(fit),
        figure_section(lambda figure: plot_fit(fit, figure), "Measured torque, torque of the model and residual of each joint"),
        _parameters(fit),
        _limits(fit),
        section("Log", f"<pre>{escape(str(fit.log.report))}</pre>"),
    ]
    write_report("LogFit.report", path, heading, body)


def _refuted(fit: Any) -> str:
    if not fit.refuted:
        return ""
    rows = [[each.name, each.sentence, f"{each.p_value:.1g}", f"{100.0 * each.share:.0f} %", each.advice] for each in fit.refuted]
    caption = "Family level 5 %; the first entry explains most of the residual, and each later one what remains"
    return section("Refuted assumptions", table(caption, ["assumption", "finding", "p", "explained", "advice"], rows))


def _parameters(fit: Any) -> str:
    rows = [
        [name, f"{value:.6g}", f"{deviation:.2g}"] for name, value, deviation in zip(fit.names, fit.values, fit.deviations, strict=True)
    ]
    condition = f"rank {fit.rank} of {len(fit.names)}, condition number {fit.condition:.3g}, cutoff of the filter {fit.cutoff:g} Hz"
    return section(
        "Parameters",
        table(f"Values and standard deviations in SI units; {condition}", ["parameter", "value", "deviation"], rows),
        table(
            "Root mean square of the residual, N m or N",
            ["joint", "residual"],
            [[joint, f"{residual:.4g}"] for joint, residual in zip(fit.joints, fit.residuals, strict=True)],
        ),
    )


def _limits(fit: Any) -> str:
    lines = [*fit.unidentifiable, *(f"correlated ({ratio:.3f}): {one} and {other}" for one, other, ratio in fit.correlated)]
    return section("Limits of this log", "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>") if lines else ""
