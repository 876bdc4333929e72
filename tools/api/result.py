"""What every result of the API has: sentences, tables, a page for notebooks. Nothing in it can be changed."""

import html
import importlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from glider.tools.data.errors import need

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from xarray import Dataset

EXTRA = "notebook"  # brings pandas, xarray and matplotlib
SHOWN_ROWS = 20  # of a table in a notebook


class Result:
    """Base of the API's results.

    A subclass gives its sentences (`_lines`) and its table (`_columns`); the rest follows from these.
    """

    def _lines(self) -> list[str]:
        """The sentences that the command prints, one a line."""
        raise NotImplementedError

    def _columns(self) -> dict[str, list[Any]]:
        """The table of the result: a list of equal length for every column."""
        raise NotImplementedError

    def summary(self) -> str:
        """Return the sentences that the command prints, one a line.

        Returns
        -------
        str
        """
        return "\n".join(self._lines())

    def __str__(self) -> str:
        return self.summary()

    def to_pandas(self) -> "DataFrame":
        """Return the result's table.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MissingExtra
            If pandas is not installed (extra `notebook`).
        """
        need(EXTRA, "pandas")
        return importlib.import_module("pandas").DataFrame(self._columns())

    def to_xarray(self) -> "Dataset":
        """Return the result's table as a dataset with one dimension, `row`.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        MissingExtra
            If xarray is not installed (extra `notebook`).
        """
        need(EXTRA, "xarray")
        columns = {name: ("row", np.asarray(values)) for name, values in self._columns().items()}
        return importlib.import_module("xarray").Dataset(columns)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the result.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw into. Default: axes of a new figure, which is not registered with pyplot.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        MissingExtra
            If matplotlib is not installed (extra `notebook`).
        """
        need(EXTRA, "matplotlib")
        if ax is None:
            figure = importlib.import_module("matplotlib.figure").Figure(figsize=(7.0, 4.0), layout="constrained")
            ax = figure.subplots()
        self._draw(ax)
        return ax

    def _draw(self, ax: "Axes") -> None:
        """Draw into axes."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        """The sentences and the first rows of the table, for a notebook."""
        sentences = html.escape(self.summary())
        columns = self._columns()
        rows = list(zip(*columns.values(), strict=True))
        head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(_cell(value))}</td>" for value in row) + "</tr>"
            for row in rows[:SHOWN_ROWS]
        )
        more = f"<p>and {len(rows) - SHOWN_ROWS} rows more</p>" if len(rows) > SHOWN_ROWS else ""
        return f"<pre>{sentences}</pre><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _cell(value: Any) -> str:
    """A value of a table in a notebook."""
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def frozen(value: Any) -> Any:
    """A JSON value that cannot be changed: mappings as read-only views, lists as tuples."""
    if isinstance(value, Mapping):
        return MappingProxyType({key: frozen(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return tuple(frozen(item) for item in value)
    return value


def read_only(values: np.ndarray) -> np.ndarray:
    """A view of an array through which it cannot be written."""
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view
