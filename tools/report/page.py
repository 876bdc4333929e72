"""Pages: a template of this folder with the common style, filled in; one HTML file that needs nothing else."""

from importlib.resources import files
from typing import Any

REPORT = "report.html"  # of a folder of an answer


def text_of(name: str) -> str:
    """A file of this folder."""
    return files("glider.tools.report").joinpath(name).read_text(encoding="utf-8")


def plotting(script: str) -> dict[str, str]:
    """What a page with charts of uPlot holds: `library`, `licence`, `plot_style` and its own `script`.

    The library's first line is a comment with its address; the licence says whose it is.
    """
    return {
        "library": text_of("vendor/uPlot.iife.min.js").partition("\n")[2].strip(),
        "licence": "uPlot 1.6.32\n" + text_of("vendor/uPlot.LICENSE").strip(),
        "plot_style": text_of("vendor/uPlot.min.css").strip() + "\n" + text_of("traces.css").strip(),
        "script": text_of(script).strip(),
    }


def render(template: str, context: dict[str, Any]) -> str:
    """The text of a page. Every name that the template uses must be in the context."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=FunctionLoader(text_of),
    )  # fmt: skip
    return environment.from_string(text_of(template)).render(context | {"style": text_of("page.css")})
