"""The errors a user can cause: one line saying what and where. Anything else is a defect and shows its traceback."""

import functools
import re
from importlib.util import find_spec

from glider.tools.data.version import DISTRIBUTION

DONE, FAILED, BAD_INPUT, STOPPED = 0, 1, 2, 130  # exit codes of every command; the last after Ctrl-C
IMPORTED_AS = {"foxglove-sdk": "foxglove"}  # packages that are imported by another name than they are installed by


class InputError(ValueError):
    """Input that cannot be used; str() is the one line the user sees, `file:line: what` as far as it is known."""

    def __init__(self, message: str, *, source: object = None, line: int | None = None, column: str | None = None):
        where = "" if source is None else (f"{source}:{line}" if line else f"{source}")
        parts = [part for part in (where, column, message) if part]
        super().__init__(": ".join(parts))


class MissingExtra(RuntimeError):
    """What is asked for needs packages that the base install leaves out."""

    def __init__(self, package: str, extra: str):
        super().__init__(f"this needs {package}: pip install '{DISTRIBUTION}[{extra}]'")


@functools.cache
def extras() -> dict[str, tuple[str, ...]]:
    """The packages that each extra of pyproject.toml brings, as they are imported."""
    from importlib import metadata  # here: --help and most commands do without

    found: dict[str, tuple[str, ...]] = {}
    for line in metadata.requires(DISTRIBUTION) or ():
        asked, _, condition = line.partition(";")
        extra = re.search(r"extra == ['\"](\w+)", condition)
        if extra and not asked.startswith(f"{DISTRIBUTION}["):
            names = re.findall(r"[a-zA-Z][\w-]*", re.split("[<>=!~]", asked)[0])  # dask[distributed] is two
            imported = (IMPORTED_AS.get(name, name.replace("-", "_")) for name in names)
            found[extra[1]] = (*found.get(extra[1], ()), *imported)
    return found


def need(extra: str, *packages: str) -> None:
    """MissingExtra for the first package of an extra that is not installed: said before any work is done.

    packages: those of the extra that are asked for (default: all).
    """
    for package in packages or extras()[extra]:
        if find_spec(package) is None:
            raise MissingExtra(package, extra)


def missing_extra(error: ModuleNotFoundError) -> MissingExtra | None:
    """What to install for an import that failed; None where no extra brings it: then it is a defect."""
    package = (error.name or "").partition(".")[0]
    return next((MissingExtra(package, extra) for extra, brought in extras().items() if package in brought), None)
