"""`glider gap compare`: two answers side by side."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_lines
from glider.tools.data.errors import need


@click.command()
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@json_option
def compare(a: Path, b: Path, as_json: bool) -> None:
    """Compare two diagnoses, each the folder of `glider gap diagnose --out` or its diagnosis.json.

    Verdicts, probabilities and gaps stand side by side. A size differs if the 90 % interval of the difference of the
    two estimates, taken as independent, leaves 0 out.
    """
    from glider.tools.report.compare import compare as compare_answers
    from glider.tools.report.compare import lines

    need("analysis")
    found = compare_answers(a, b)
    print_lines(lines(found), as_json, found)
