"""Rows out of lines that are not all whole: records over several lines, rows broken in two, lines to pass over.

Everything here takes and gives `Line`s: the number of a line (from 1, of its last where there are several) and its
fields.
"""

from collections.abc import Iterable, Iterator
from typing import Annotated

import msgspec

from glider.hal.strict import Table

Line = tuple[int, list[str]]


class LineTable(Table):
    """[[text.line]]: one line of a record that is written over several: by its number of fields, or its first field."""

    fields: Annotated[int, msgspec.Meta(ge=1, le=10_000)]
    begins: str = ""


def distinguishable(lines: tuple[LineTable, ...]) -> bool:
    """Whether no line of a record can be taken for another of its lines."""
    return len({(line.fields, line.begins) for line in lines}) == len(lines) and not any(
        one.fields == other.fields and not (one.begins and other.begins)
        for n, one in enumerate(lines)
        for other in lines[:n]
    )


def _fits(line: LineTable, fields: list[str]) -> bool:
    return len(fields) == line.fields and line.begins in ("", fields[0].strip())


def over_lines(lines: Iterable[Line], record: tuple[LineTable, ...], lost: list[int]) -> Iterator[Line]:
    """Records put together of their lines in order; a line that does not belong there is lost, and with it those of
    its record. Blank lines are passed over. Numbers of lost lines are added to `lost`."""
    begun: list[Line] = []
    for number, fields in lines:
        if fields in ([], [""]):
            continue
        if not _fits(record[len(begun)], fields):
            lost += [n for n, _ in begun]
            begun = []
            if not _fits(record[0], fields):
                lost.append(number)
                continue
        begun.append((number, fields))
        if len(begun) == len(record):
            yield number, [field for _, part in begun for field in part]
            begun = []
    lost += [n for n, _ in begun]


def joined(lines: list[Line], width: int) -> list[Line]:
    """Rows of `width` fields, those put together that a line's end broke in two: between two fields, or within one."""
    found: list[Line] = []
    for number, fields in lines:
        before = found[-1][1] if found else []
        # at a delimiter, one half has an empty field and may look whole
        first = 0 < len(before) < width or (len(before) == width and not before[-1].strip())
        second = len(fields) < width or (len(fields) == width and not fields[0].strip())
        if first and second and len(before) + len(fields) == width:
            found[-1] = number, before + fields
        elif first and second and len(before) + len(fields) == width + 1:
            found[-1] = number, [*before[:-1], before[-1] + fields[0], *fields[1:]]
        else:
            found.append((number, fields))
    return found
