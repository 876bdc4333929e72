"""CSV tables, strict in and lossless out: bounded, UTF-8, gzipped or not; a complaint names file, line and column."""

import contextlib
import csv
import gzip
import io
import math
import re
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, BinaryIO, Literal

import msgspec
import numpy as np

from glider.hal.strict import Table as StrictTable
from glider.tools.data.errors import InputError
from glider.tools.data.files import write_bytes
from glider.tools.data.runs.records import Line, LineTable, distinguishable, joined, over_lines

MAX_BYTES = 256_000_000  # unpacked; an hour at 50 Hz with forty columns of full precision is half of it
_NUMBERS = msgspec.json.Decoder(list[float | None])
NO_WORDS: Mapping[str, float] = MappingProxyType({})
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


class Dialect(StrictTable):
    """How a table is written: as run data by default, as other loggers do on request. [text] of a mapping file."""

    delimiter: Annotated[str, msgspec.Meta(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    encoding: Literal["utf-8", "latin-1"] = "utf-8"
    quotes: bool = True  # false: a quotation mark is a letter, and damage in a number
    skip_lines: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 0  # above the header
    header: tuple[str, ...] = ()  # for files that have none
    comment: str = ""  # lines that begin so are passed over
    line: tuple[LineTable, ...] = ()  # a record is written over these lines
    missing: tuple[str, ...] = ()  # what stands for a missing sample, beside nothing
    broken_rows: Literal["refuse", "drop", "join"] = "refuse"  # rows of too few or too many fields
    bad_fields: Literal["refuse", "missing", "drop"] = "refuse"  # fields that are no number; drop: with their row

    def __post_init__(self):
        if not distinguishable(self.line):
            raise ValueError("line: expected lines of different numbers of fields, or of different `begins`")
        if any(line.begins for line in self.line) and not self.header:
            raise ValueError("header: missing; records of lines with `begins` have none of their own")

    @property
    def patient(self) -> bool:
        """Whether damage is expected, so that bytes that are no text are some more of it."""
        return self.broken_rows != "refuse" or self.bad_fields != "refuse"


RUN_DATA = Dialect()
OTHER_DELIMITERS = (";", "\t", "|", ",")


class CsvTable:
    """A CSV file's header and its fields, still text, by column. `broken` has the lines of broken rows left out,
    `joined` counts those that were put together."""

    def __init__(self, path: Path, data: bytes, dialect: Dialect = RUN_DATA):
        self.path = path
        self._dialect = dialect
        self._text, self._above = self._decoded(data)
        self.broken: list[int] = []
        self.joined = 0
        rows = self._rows()
        try:
            header = list(dialect.header) or next(rows)[1]
            self.header = [name.strip() for name in header]
            body = list(rows)
        except StopIteration:
            raise self.error("the file is empty") from None
        while body and body[-1][1] in ([], [""]):
            body.pop()
        self._check_header()
        if not body:
            raise self.error("no samples below the header")
        # One pass in C for the usual case; the slow search for the line only once something is known to be wrong.
        fields = [row for _, row in body]
        if set(map(len, fields)) != {len(self.header)}:
            body = self._without_broken(body)
            fields = [row for _, row in body]
        self._lines = [number for number, _ in body]
        self._columns = dict(zip(self.header, zip(*fields, strict=True), strict=True))

    def _without_broken(self, body: list[Line]) -> list[Line]:
        width = len(self.header)
        if self._dialect.broken_rows == "join":
            whole = joined(body, width)
            self.joined, body = len(body) - len(whole), whole
        good = [row for row in body if len(row[1]) == width]
        broken = [row for row in body if len(row[1]) != width]
        if broken and (self._dialect.broken_rows == "refuse" or not good):
            number, row = broken[0]
            few = "too few" if len(row) < width else "too many"
            way = "" if self._dialect is RUN_DATA else ' (text.broken_rows = "drop" or "join" lets such rows pass)'
            raise self.error(f"{few} fields: expected {width}, got {len(row)}{way}", line=number)
        self.broken = sorted([*self.broken, *(number for number, _ in broken)])
        return good

    def _decoded(self, data: bytes) -> tuple[str, int]:
        """The text from the header on, and the number of lines above it."""
        encoding = "utf-8-sig" if self._dialect.encoding == "utf-8" else self._dialect.encoding
        try:
            text = data.decode(encoding, errors="replace" if self._dialect.patient else "strict")
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise InputError(f"not UTF-8 text (byte {error.start})", source=self.path, line=line) from None
        for number in range(self._dialect.skip_lines):
            _, newline, text = text.partition("\n")
            if not newline:
                raise self.error(f"{self._dialect.skip_lines} lines above the header expected, {number} found")
        return text, self._dialect.skip_lines

    def _rows(self) -> Iterator[Line]:
        lines: Iterator[Line] = self._fields()
        if self._dialect.comment:
            lines = (line for line in lines if not (line[1] and line[1][0].startswith(self._dialect.comment)))
        if self._dialect.line:
            lines = over_lines(lines, self._dialect.line, self.broken)
        return lines

    def _fields(self) -> Iterator[Line]:
        text, delimiter = self._text, self._dialect.delimiter
        if not text:
            return
        if not self._dialect.quotes or '"' not in text:
            # No quotes, so no field spans lines or hides a comma: splitting is the same as csv and twice as fast.
            lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
            yield from enumerate([line.split(delimiter) for line in lines], start=self._above + 1)
            return
        reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=delimiter)
        try:
            for row in reader:
                yield self._above + reader.line_num, row
        except csv.Error as error:
            raise InputError(f"not CSV: {error}", source=self.path, line=self._above + reader.line_num) from None

    def _check_header(self) -> None:
        foreign = len(self.header) == 1 and self._dialect is not RUN_DATA
        other = next((one for one in OTHER_DELIMITERS if foreign and one in self.header[0]), None)
        if other is not None:
            shown = r"\t" if other == "\t" else other
            raise self.error(f'one column in the header: text.delimiter = "{shown}" would part it', line=1)
        seen: set[str] = set()
        for name in self.header:
            if name in seen:
                raise self.error("the column stands twice", column=name or "(no name)", line=1)
            seen.add(name)

    def line(self, row: int) -> int:
        """Line (from 1) on which a row (from 0, below the header) ends."""
        return self._lines[row]

    def error(self, message: str, *, row: int | None = None, column: str | None = None, line: int | None = None):
        """An InputError of this file: `row` counts from 0 below the header."""
        return InputError(message, source=self.path, line=line if row is None else self.line(row), column=column)

    @property
    def rows(self) -> int:
        return len(self._columns[self.header[0]])

    def texts(self, column: str) -> list[str]:
        """A column as it stands."""
        return list(self._columns[column])

    def numbers(self, column: str, words: Mapping[str, float] = NO_WORDS) -> np.ndarray:
        """A column as float64, shape (rows,); NaN for an empty field; InputError for anything but a finite number.

        Where there are `words`, each stands for its number, and nothing else is one.
        """
        values, bad = self.numbers_and_bad(column, words)
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            hint = "" if self._dialect is RUN_DATA else _reading(self._columns[column][row])
            raise self.error(_complaint(self._plain(self._columns[column])[row]) + hint, row=row, column=column)
        return values

    def numbers_and_bad(self, column: str, words: Mapping[str, float] = NO_WORDS) -> tuple[np.ndarray, np.ndarray]:
        """The same, NaN also for what is no number, and where that is so, bool of shape (rows,)."""
        fields = self._plain(self._columns[column])
        joined = ",".join(fields)
        if not words and "n" not in joined:  # a field 'null' is not a missing sample
            if "" in fields:
                joined = ",".join([field or "null" for field in fields])
            # JSON's numbers are a strict part of ours and decode five times as fast; what they leave out, and
            # every error, takes the slow way.
            with contextlib.suppress(msgspec.DecodeError):
                values = np.array(_NUMBERS.decode(f"[{joined}]"), dtype=np.float64)
                if len(values) == len(fields):
                    return values, np.zeros(len(fields), dtype=bool)
        found = [words.get(field.strip()) if words and field.strip() else _number(field) for field in fields]
        bad = np.array([value is None for value in found])
        return np.array([math.nan if value is None else value for value in found]), bad

    def _plain(self, fields: tuple[str, ...]) -> tuple[str, ...]:
        """Fields as run data would have them."""
        if self._dialect.decimal != ".":
            fields = tuple(field.replace(self._dialect.decimal, ".") for field in fields)
        if self._dialect.missing:
            fields = tuple("" if field.strip() in self._dialect.missing else field for field in fields)
        return fields

    def require_increasing(self, column: str, values: np.ndarray) -> None:
        """InputError unless every sample is there and each is greater than the one before."""
        if np.isnan(values).any():
            raise self.error("a missing sample", row=int(np.flatnonzero(np.isnan(values))[0]), column=column)
        back = np.flatnonzero(np.diff(values) <= 0.0)
        if back.size:
            row = int(back[0]) + 1
            message = f"not increasing: {values[row]} after {values[row - 1]}"
            raise self.error(message, row=row, column=column)


def _as_float(field: str) -> float | None:
    """A field as Python reads it; None if it does not."""
    # float() takes more than a number in a table should be: '1_000', digits of other scripts.
    try:
        return float(field) if field.isascii() and "_" not in field else None
    except ValueError:
        return None


def _number(field: str) -> float | None:
    """A field as a number: NaN if it is empty, None if it is none or is not finite."""
    if not field.strip():
        return math.nan
    value = _as_float(field)
    return value if value is not None and math.isfinite(value) else None


def _complaint(field: str) -> str:
    """What is wrong with a field that is no number."""
    field = field.strip()
    value, shown = _as_float(field), repr(field if len(field) <= _SHOWN else field[:_SHOWN] + "...")
    if value is not None and math.isinf(value):
        return f"infinite: {shown}"
    return f"not a number: {shown}" + (" (a missing sample is an empty field)" if value is not None else "")


def _reading(field: str) -> str:
    """How a mapping would read a field that is no number, in brackets; empty where that is not known."""
    if "," in field and _as_float(field.strip().replace(",", ".")) is not None:
        return ' (text.decimal = "," reads it)'
    if re.fullmatch(r"\d{1,2}:\d{2}(:\d{2}([.,]\d*)?)?", field.strip()):
        return ' (time.unit = "clock" reads it)'
    if re.match(r"\d{4}-\d{2}-\d{2}", field.strip()):
        return ' (time.unit = "iso8601" reads it)'
    return ""


def read_table(path: Path, dialect: Dialect = RUN_DATA) -> CsvTable:
    """A CSV or .csv.gz file as text columns; InputError where it is none, is damaged or is too long."""
    return CsvTable(path, _read_bounded(path), dialect)


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
