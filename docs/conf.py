"""Sphinx: the site of the documentation. `make docs` builds it; generate.py writes its generated pages first."""

import re
import shutil
import sys
import unicodedata
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent))

import gallery  # noqa: E402
import generate  # noqa: E402
import states  # noqa: E402
import ziamath  # noqa: E402
from docutils.nodes import SkipNode  # noqa: E402
from latex2mathml.converter import convert  # noqa: E402

project = "glider"
author = "the glider project"
copyright = author
extensions = [
    "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click",
    "sphinxcontrib.bibtex",
]  # fmt: skip
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
bibtex_bibfiles = ["references.bib"]
exclude_patterns = ["tutorials/files", "generated/parts", "results"]
html_theme = "furo"
html_title = "glider"
html_static_path = ["static", "generated/fonts"]
html_css_files = ["site.css"]
default_role = "code"
smartquotes = False  # `--option` stays as it is typed
html_math_renderer = "mathml"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_class_signature = "separated"
napoleon_google_docstring = True


def unlink_code(app, docname, source):
    """Links to files of the repository are for the forge: the site shows their text."""
    source[0] = re.sub(
        r"\[([^\]]*)\]\((?:\.\./)+((?:firmware|hal|sim_backend|tools|tests)/[^)]*|[A-Z]+\.md|CITATION\.cff)\)",
        r"`\2`",
        source[0],
    )


def draw_states(app, docname, source):
    """A forge draws state diagrams from their text; the site has a picture."""
    source[0] = states.drawn(source[0], HERE / "generated" / "states.svg", "../generated/states.svg")


def skip_constructor(app, what, name, obj, skip, options):
    """Results are made by functions: their constructors are no part of the API."""
    return True if name == "__init__" else None


def tidy_docstring(app, what, name, obj, options, lines):
    """Docstrings are plain prose: markup that Sphinx would misread is escaped."""
    lines[:] = [line.replace("*", r"\*").replace("|", r"\|").replace("_,", r"\_,") for line in lines]


def tidy_help(app, command, lines):
    """Help of commands is plain prose, too."""
    lines[:] = [line.replace("*", r"\*") for line in lines]


STYLES = {"bold": "BOLD", "double-struck": "DOUBLE-STRUCK", "script": "SCRIPT", "sans-serif": "SANS-SERIF"}


def styled(match):
    """A letter of a style as its own character: browsers ignore the attribute."""
    style, letter = STYLES[match[1]], match[2]
    name = f"{style} {'CAPITAL' if letter.isupper() else 'SMALL'} {letter.upper()}"
    try:
        return f"<mi>{unicodedata.lookup(f'MATHEMATICAL {name}')}</mi>"
    except KeyError:  # some letters were there before the others
        return f"<mi>{unicodedata.lookup(name)}</mi>"


def spaced(match):
    """The name of a function with the space around it that its arguments leave."""
    before, name, after = '<mspace width="0.17em"/>', match[1], match[2]
    behind = "" if after.startswith("<mo") else before
    return f"<mrow>{before}<mi>{name}</mi>{behind}</mrow>{after}"


def mathml(latex, display="inline"):
    """A formula as MathML, which browsers draw without a script from elsewhere."""
    text = convert(latex, display=display)
    text = re.sub(r"<mo[^>]*>(&#x0007C;|&#x02016;)</mo>", r'<mo stretchy="false" lspace="0" rspace="0">\1</mo>', text)
    text = re.sub(r"<mi>(cos|sin|tan|ln|det|exp)</mi>(<\w+)", spaced, text)
    return re.sub(rf'<mi mathvariant="({"|".join(STYLES)})">([A-Za-z])</mi>', styled, text)


def inline_formula(translator, node):
    """A formula within a line."""
    translator.body.append(mathml(node.astext()))
    raise SkipNode


def formula(translator, node):
    """A displayed formula; a wide one scrolls by itself."""
    translator.body.append(f'<div class="math-block">{mathml(node.astext(), "block")}</div>')
    raise SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", (inline_formula, None), (formula, None))
    generate.write_all(HERE / "generated")
    gallery.write(HERE / "generated" / "causes")
    fonts = HERE / "generated" / "fonts"
    fonts.mkdir(exist_ok=True)
    shutil.copy(Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf", fonts)
    app.connect("source-read", unlink_code)
    app.connect("source-read", draw_states)
    app.connect("autodoc-skip-member", skip_constructor)
    for part in ("description", "options", "arguments"):
        app.connect(f"sphinx-click-process-{part}", tidy_help)
    app.connect("autodoc-process-docstring", tidy_docstring, priority=900)
