"""CSV tables, strict in and lossless out: bounded, UTF-8, gzipped or not; a complaint names file, line and column."""

import contextlib
import csv
import gzip
import io
import math
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal

import msgspec
import numpy as np

from tools.data.errors import InputError

MAX_BYTES = 256_000_000  # unpacked; an hour at 50 Hz with forty columns of full precision is half of it
_NUMBERS = msgspec.json.Decoder(list[float | None])
_SHOWN = 40  # characters of a wrong field that an error quotes


def _read_bounded(path: Path) -> bytes:
    """The file's bytes, unpacked; InputError for what cannot be read, is damaged or is longer than MAX_BYTES."""
    try:
        with path.open("rb") as raw:
            stream: BinaryIO = gzip.GzipFile(fileobj=raw) if path.name.endswith(".gz") else raw  # type: ignore[assignment]
            data = stream.read(MAX_BYTES + 1)
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise InputError(f"damaged gzip: {error}", source=path) from None
    except OSError as error:
        raise InputError(error.strerror or str(error), source=path) from None
    if len(data) > MAX_BYTES:
        raise InputError(f"longer than {MAX_BYTES} bytes", source=path)
    return data


@dataclass(frozen=True)
class Dialect:
    """How a table is written: as run data by default, as other loggers do if told."""

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    skip_lines: int = 0  # above the header
    header: tuple[str, ...] = ()  # for files that have none
    missing: frozenset[str] = frozenset()  # what stands for a missing sample, beside nothing
    drop_broken_rows: bool = False


class Table:
    """A CSV file's header and its fields, still text, by column. `dropped` counts the broken rows left out."""

    def __init__(self, path: Path, data: bytes, dialect: Dialect = Dialect()):
        self.path = path
        self._dialect = dialect
        self._text, self._above = self._decoded(data)
        self.dropped = 0
        self._numbers_of_rows: list[int] | None = None  # of the rows that are left, where some were dropped
        rows = self._rows()
        try:
            header = list(dialect.header) or next(rows)
            self.header = [name.strip() for name in header]
            body = list(rows)
        except StopIteration:
            raise self.error("the file is empty") from None
        while body and body[-1] in ([], [""]):
            body.pop()
        self._check_header()
        if not body:
            raise self.error("no samples below the header")
        # One pass in C for the usual case; the slow search for the line only once something is known to be wrong.
        if set(map(len, body)) != {len(self.header)}:
            body = self._without_broken(body)
        self._columns = dict(zip(self.header, zip(*body, strict=True), strict=True))

    def _without_broken(self, body: list[list[str]]) -> list[list[str]]:
        width = len(self.header)
        good = [number for number, row in enumerate(body) if len(row) == width]
        if not self._dialect.drop_broken_rows or not good:
            number = next(number for number, row in enumerate(body) if len(row) != width)
            got = len(body[number])
            few = "too few" if got < width else "too many"
            raise self.error(f"{few} fields: expected {width}, got {got}", row=number)
        self.dropped = len(body) - len(good)
        self._numbers_of_rows = good
        return [body[number] for number in good]

    def _decoded(self, data: bytes) -> tuple[str, int]:
        """The text from the header on, and the number of lines above it."""
        encoding = "utf-8-sig" if self._dialect.encoding == "utf-8" else self._dialect.encoding
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise InputError(f"not UTF-8 text (byte {error.start})", source=self.path, line=line) from None
        for number in range(self._dialect.skip_lines):
            _, newline, text = text.partition("\n")
            if not newline:
                raise self.error(f"{self._dialect.skip_lines} lines above the header expected, {number} found")
        return text, self._dialect.skip_lines

    def _rows(self) -> Iterator[list[str]]:
        text, delimiter = self._text, self._dialect.delimiter
        if not text:
            return
        if '"' not in text:
            # No quotes, so no field spans lines or hides a comma: splitting is the same as csv and twice as fast.
            lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
            yield from [line.split(delimiter) for line in lines]
            return
        reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=delimiter)
        try:
            yield from reader
        except csv.Error as error:
            raise InputError(f"not CSV: {error}", source=self.path, line=self._above + reader.line_num) from None

    def _check_header(self) -> None:
        seen: set[str] = set()
        for name in self.header:
            if name in seen:
                raise self.error("the column stands twice", column=name or "(no name)", line=1)
            seen.add(name)

    def _line(self, row: int) -> int:
        """Line (from 1) on which a row (from 0, below the header) ends; fields in quotes may span lines."""
        if self._numbers_of_rows is not None:
            row = self._numbers_of_rows[row]
        rows = row + (1 if self._dialect.header else 2)
        if '"' not in self._text:
            return self._above + rows
        reader = csv.reader(io.StringIO(self._text, newline=""), strict=True, delimiter=self._dialect.delimiter)
        for _ in range(rows):
            next(reader)
        return self._above + reader.line_num

    def error(self, message: str, *, row: int | None = None, column: str | None = None, line: int | None = None):
        """An InputError of this file: `row` counts from 0 below the header."""
        return InputError(message, source=self.path, line=line if row is None else self._line(row), column=column)

    @property
    def rows(self) -> int:
        return len(self._columns[self.header[0]])

    def texts(self, column: str) -> list[str]:
        """A column as it stands."""
        return list(self._columns[column])

    def numbers(self, column: str) -> np.ndarray:
        """A column as float64, shape (rows,); NaN for an empty field; InputError for anything but a finite number."""
        fields = self._plain(self._columns[column])
        joined = ",".join(fields)
        if "n" not in joined:  # a field 'null' is not a missing sample
            if "" in fields:
                joined = ",".join([field or "null" for field in fields])
            # JSON's numbers are a strict part of ours and decode five times as fast; what they leave out, and
            # every error, takes the slow way.
            with contextlib.suppress(msgspec.DecodeError):
                values = np.array(_NUMBERS.decode(f"[{joined}]"), dtype=np.float64)
                if len(values) == len(fields):
                    return values
        return np.array([self._number(field.strip(), row, column) for row, field in enumerate(fields)])

    def _plain(self, fields: tuple[str, ...]) -> tuple[str, ...]:
        """Fields as run data would have them."""
        if self._dialect.decimal != ".":
            fields = tuple(field.replace(self._dialect.decimal, ".") for field in fields)
        if self._dialect.missing:
            fields = tuple("" if field.strip() in self._dialect.missing else field for field in fields)
        return fields

    def _number(self, field: str, row: int, column: str) -> float:
        if not field:
            return math.nan
        shown = repr(field if len(field) <= _SHOWN else field[:_SHOWN] + "...")
        # float() takes more than a number in a table should be: '1_000', digits of other scripts.
        try:
            value = float(field) if field.isascii() and "_" not in field else None
        except ValueError:
            value = None
        if value is None:
            raise self.error(f"not a number: {shown}", row=row, column=column)
        if math.isnan(value):
            raise self.error(f"not a number: {shown} (a missing sample is an empty field)", row=row, column=column)
        if math.isinf(value):
            raise self.error(f"infinite: {shown}", row=row, column=column)
        return value

    def require_increasing(self, column: str, values: np.ndarray) -> None:
        """InputError unless every sample is there and each is greater than the one before."""
        if np.isnan(values).any():
            raise self.error("a missing sample", row=int(np.flatnonzero(np.isnan(values))[0]), column=column)
        back = np.flatnonzero(np.diff(values) <= 0.0)
        if back.size:
            row = int(back[0]) + 1
            message = f"not increasing: {values[row]} after {values[row - 1]}"
            raise self.error(message, row=row, column=column)


def read_table(path: Path, dialect: Dialect = Dialect()) -> Table:
    """A CSV or .csv.gz file as text columns; InputError where it is none, is damaged or is too long."""
    return Table(path, _read_bounded(path), dialect)


def as_texts(name: str, values: np.ndarray, places: int | None = None) -> list[str]:
    """Numbers as fields: the shortest exact text, or `places` decimals; empty for NaN; ValueError for infinite ones."""
    values = np.asarray(values, dtype=np.float64)
    if np.isinf(values).any():
        raise ValueError(f"column {name} holds an infinite value")
    plain = values.tolist()
    if places is None:
        texts = list(map(repr, plain))
    else:
        texts = [f"{value:.{places}f}" for value in plain]
    for row in np.flatnonzero(np.isnan(values)):
        texts[row] = ""
    return texts


def encode_table(columns: dict[str, list[str]]) -> bytes:
    """Columns of text as CSV, UTF-8; ValueError where they are of unequal length, or none."""
    if len({len(values) for values in columns.values()}) != 1:
        raise ValueError("columns of unequal length, or none")
    text = _as_csv(columns, csv.QUOTE_MINIMAL)
    if "\r" in text:  # the csv module leaves a lone carriage return without quotes
        text = _as_csv(columns, csv.QUOTE_ALL)
    return text.encode("utf-8")


def _as_csv(columns: dict[str, list[str]], quoting: Literal[0, 1]) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n", quoting=quoting)
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def write_table(path: Path, columns: dict[str, list[str]]) -> None:
    """Columns of text as CSV (gzipped by the name), through a temporary file beside it, so whole or not at all."""
    data = encode_table(columns)
    if path.name.endswith(".gz"):
        data = gzip.compress(data, compresslevel=6, mtime=0)  # no time inside: equal runs are equal files
    write_bytes(path, data)


def write_bytes(path: Path, data: bytes) -> None:
    """A file, whole or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
