"""Read columns of numbers from text: any separator, comments, a header line, and decimal commas between other separators."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import open_regular

__all__ = ["TextTable", "open_table"]

#: Separators in the order of preference. None separates at blanks.
_SEPARATORS = (";", "\t", ",", "|", None)
#: The header is in the first lines of a file, and these lines are not longer.
_LINES, _LONGEST = 200, 1 << 20
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?$")


@dataclass(frozen=True)
class TextTable:
    """A text file with columns of numbers."""

    function: str
    path: str
    #: Names of the columns. A file without a header has empty names.
    headers: tuple[str, ...]
    separator: str | None
    #: Number of lines before the first row of numbers.
    skipped: int
    #: Whether the decimal point is a comma.
    comma: bool

    def read(self, columns: Sequence[int]) -> NDArray[np.float64]:
        """Read the numbers of the columns, (K, columns).

        Raises:
            InputError: a cell is not a number; the message has its line and its column.
        """
        try:
            # A path is read faster than an open file.
            with _text(self.path) as file:
                source = (line.replace(",", ".") for line in file) if self.comma else self.path
                options: dict[str, Any] = {
                    "skiprows": self.skipped,
                    "usecols": list(columns),
                    "ndmin": 2,
                    "quotechar": '"',
                    "encoding": "latin-1",
                }
                rows: NDArray[np.float64] = np.loadtxt(source, delimiter=self.separator, **options)
        except ValueError as error:
            raise self._fault(columns, str(error)) from None
        return rows

    def line(self, row: int) -> int:
        """The number of the line, from 1, with the row `row` of numbers, from 0."""
        return next(number for count, (number, _) in enumerate(self._rows()) if count == row)

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """The lines with numbers: number of the line from 1, and its cells."""
        with _text(self.path) as file:
            for number, line in enumerate(file, 1):
                line = line.partition("#")[0].rstrip("\r\n")
                if number > self.skipped and line.strip():
                    yield number, _cells(line, self.separator)

    def _fault(self, columns: Sequence[int], reason: str) -> InputError:
        """The error for the first cell that is not a number."""
        where = f"{self.function}: {self.path}"
        for number, cells in self._rows():
            if len(cells) <= max(columns):
                return InputError(f"{where} line {number} is incomplete: expected {len(self.headers)} columns, got {len(cells)}")
            for column in columns:
                if not _is_number(cells[column], self.comma):
                    name = f" ({self.headers[column]})" if self.headers[column] else ""
                    problem = f"is not a number: expected a number, got {cells[column][:60]!r}"
                    return InputError(f"{where} line {number}, column {column + 1}{name} {problem}")
        return InputError(f"{where} is not a table of numbers: {reason}")


def open_table(function: str, path: str) -> TextTable:
    """Find the separator, the header and the first row of numbers of a text file.

    Raises:
        InputError: the file is empty, is not text, or has no row of numbers.
        OSError: the file cannot be read.
    """
    lines, part = _first_lines(function, path)
    for separator in _SEPARATORS:
        # A comma in a number is a decimal point if it does not separate the cells.
        comma = separator in (";", "\t") and any(_DECIMAL_COMMA.match(cell) for line in lines for cell in _cells(line, separator))
        found = _layout(lines, separator, comma, complete=not part)
        if found is not None:
            return TextTable(function, path, found[0], separator, found[1], comma)
    raise InputError(f"{function}: {path} has no rows of numbers: expected a header and rows of numbers, got {lines[0][:80]!r}")


def _first_lines(function: str, path: str) -> tuple[list[str], bool]:
    """The first lines of the file, and whether the file has more lines."""
    with open_regular(path) as file:
        head = file.read(_LONGEST)
        more = bool(file.read(1))
    if not head.strip():
        raise InputError(f"{function}: {path} is empty: expected a header and rows of numbers, got none")
    if b"\0" in head:
        raise InputError(f"{function}: {path} is not text: expected a text file such as CSV, got binary data")
    lines = head.decode("utf-8-sig", "replace").splitlines()
    if more:
        lines = lines[:-1] or lines
    return lines[:_LINES], more or len(lines) > _LINES


def _layout(lines: list[str], separator: str | None, comma: bool, complete: bool) -> tuple[tuple[str, ...], int] | None:
    """The names of the columns and the number of lines before the numbers; None if the separator does not fit.

    The numbers begin at the line after the header. The header has the same number of cells, and none of them is a number. Without a
    header, they begin at the first line in which more than half of the cells are numbers.
    """
    cells = [_cells(line.lstrip("#% ") if _is_comment(line) else line, separator) for line in lines]
    filled = [i for i, line in enumerate(lines) if line.strip()]
    for place, i in enumerate(filled):
        numbers = [_is_number(cell, comma) for cell in cells[i]]
        if _is_comment(lines[i]) or not any(numbers) or (separator is not None and len(numbers) < 2):
            continue
        before = cells[filled[place - 1]] if place else []
        if len(before) == len(numbers) and not any(_is_number(cell, comma) for cell in before):
            return tuple(cell.strip() for cell in before), i
        after = cells[filled[place + 1]] if place + 1 < len(filled) else None
        if 2 * sum(numbers) > len(numbers) and (len(after) == len(numbers) if after is not None else complete and place == 0):
            return ("",) * len(numbers), i
    return None


def _text(path: str) -> io.TextIOWrapper:
    # Numbers are ASCII. With this encoding, every byte of a header is valid.
    return io.TextIOWrapper(open_regular(path), encoding="latin-1")


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "%"))


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return [cell.strip() for cell in (next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator))]


def _is_number(cell: str, comma: bool) -> bool:
    try:
        float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return False
    return "_" not in cell
