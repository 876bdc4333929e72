"""The errors a user can cause: one line saying what and where. Anything else is a defect and shows its traceback."""

from importlib.util import find_spec

DONE, FAILED, BAD_INPUT = 0, 1, 2  # exit codes of every command


class InputError(ValueError):
    """Input that cannot be used; str() is the one line the user sees, `file:line: what` as far as it is known."""

    def __init__(self, message: str, *, source: object = None, line: int | None = None, column: str | None = None):
        where = "" if source is None else (f"{source}:{line}" if line else f"{source}")
        parts = [part for part in (where, column, message) if part]
        super().__init__(": ".join(parts))


class MissingExtra(RuntimeError):
    """A command needs packages that the base install leaves out."""

    def __init__(self, package: str, extra: str = "analysis"):
        super().__init__(f"this command needs {package}: pip install 'glider[{extra}]'")


def need(*packages: str, extra: str = "analysis") -> None:
    """MissingExtra for the first of the packages that is not installed: said before any work is done."""
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtra(package, extra)
