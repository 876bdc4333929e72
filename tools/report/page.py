"""Pages: a template of this folder with the common style, filled in; one HTML file that needs nothing else."""

from importlib.resources import files
from typing import Any

REPORT = "report.html"  # of a folder of an answer


def render(template: str, context: dict[str, Any]) -> str:
    """The text of a page. Every name that the template uses must be in the context."""
    from jinja2 import Environment, StrictUndefined

    folder = files("glider.tools.report")
    text = folder.joinpath(template).read_text(encoding="utf-8")
    style = folder.joinpath("page.css").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(text).render(context | {"style": style})
