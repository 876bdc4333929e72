"""`glider reproduce`: the paper's figures, flown again, as pictures and numbers."""

from pathlib import Path

import click

from glider.tools.cli.common import compile_campaign, json_option, print_json, say
from glider.tools.data.errors import need
from glider.tools.data.files import check_writable

FIGURES = ("fig4", "fig5", "fig6", "fig7")


@click.command()
@click.argument("figures", nargs=-1, required=True, type=click.Choice(FIGURES), metavar="[fig4|fig5|fig6|fig7]...")
@click.option("--vehicle", default="roughie", show_default=True, help="Vehicle: shipped name or file.")
@click.option("--seeds", default=8, show_default=True, type=click.IntRange(2, 1000), help="Seeds a case.")
@click.option("--noise", type=click.FloatRange(0.0, 5.0), help="Strength of the JSON.  [default: 10 x vehicle's]")
@click.option("--out", type=click.Path(path_type=Path), default=Path("."), help="Folder for the pictures.")
@json_option
def reproduce(figures, vehicle, seeds, noise, out, as_json) -> None:
    """Fly the paper's Figures 5, 6 and 7 again: law, hybrid, ruled and best-tuned PID, law+; 4: its identification.

    One picture a figure, FIGURE.png; one JSON object a figure with --json (a list where several are asked for).
    """
    from glider.tools.data.sources import load_vehicle

    need("identify" if "fig4" in figures else "analysis")
    from glider.tools.study.reproduce.figures import reproduce_circle, reproduce_tracking

    the_vehicle = load_vehicle(vehicle)
    check_writable(out)
    out.mkdir(parents=True, exist_ok=True)
    results = []
    if set(figures) != {"fig4"}:
        compile_campaign()
    for name in figures:
        say(f"{name} ...")
        if name == "fig4":
            from glider.tools.study.reproduce.fig4 import reproduce_fig4

            result = reproduce_fig4(vehicle, the_vehicle, out)
        elif name == "fig7":
            result = reproduce_circle(the_vehicle, seeds, out)
        else:
            result = reproduce_tracking(name, the_vehicle, seeds, noise, out)
        results.append(result)
        if not as_json:
            _tell(result)
    if as_json:
        print_json(results[0] if len(results) == 1 else results)


def _tell(result: dict) -> None:
    """A figure's table, for a person."""
    click.echo(f"\n{result['figure']}: {result['says']}")
    for row in result["table"]:
        click.echo(
            "  "
            + "  ".join(
                f"{key} {value if isinstance(value, str) else format(value, '.3g')}"
                for key, value in row.items()
                if value is not None
            )
        )
    click.echo(f"  picture: {result['picture']}")
