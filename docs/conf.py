"""Sphinx: the site of the documentation. `make docs` builds it; generate.py writes its generated pages first."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent))

import gallery  # noqa: E402
import generate  # noqa: E402
from pygments.lexers.special import TextLexer  # noqa: E402
from sphinx.highlighting import lexers  # noqa: E402

project = "glider"
author = "the glider project"
copyright = author
extensions = [
    "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "sphinx_click",
    "sphinxcontrib.bibtex",
]  # fmt: skip
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
bibtex_bibfiles = ["references.bib"]
exclude_patterns = ["tutorials/files", "generated/parts"]
html_theme = "furo"
html_title = "glider"
html_static_path: list[str] = []
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
napoleon_google_docstring = True


def unlink_code(app, docname, source):
    """Links to files of the repository are for the forge: the site shows their text."""
    source[0] = re.sub(
        r"\[([^\]]*)\]\((?:\.\./)+((?:firmware|hal|sim_backend|tools|tests)/[^)]*|[A-Z]+\.md|CITATION\.cff)\)",
        r"`\2`",
        source[0],
    )


def tidy_docstring(app, what, name, obj, options, lines):
    """Docstrings are plain prose: markup that Sphinx would misread is escaped."""
    lines[:] = [line.replace("*", r"\*").replace("|", r"\|").replace("_,", r"\_,") for line in lines]


def setup(app):
    lexers["mermaid"] = TextLexer()  # a forge draws it; the site shows its text
    generate.write_all(HERE / "generated")
    gallery.write(HERE / "generated" / "causes")
    app.connect("source-read", unlink_code)
    app.connect("autodoc-process-docstring", tidy_docstring, priority=900)
