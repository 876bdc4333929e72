"""`glider benchmark`: the speed figures, each beside what it is compared with."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_json, say
from glider.tools.verify.benchmark.registry import MEASURES, Settings, run


def _shown(value: object) -> str:
    """A figure for people: four digits, large numbers in groups of three."""
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.4g}"
    if isinstance(value, list):
        return " ".join(_shown(item) for item in value)
    return "-" if value is None else f"{value:,}" if isinstance(value, int) else str(value)


def _measures(context: click.Context, parameter: click.Parameter, given: tuple[str, ...]) -> list[str]:
    """Names of measures, given again or with commas between them, each once."""
    names = list(dict.fromkeys(name.strip() for one in given for name in one.split(",")))
    for name in names:
        if name not in MEASURES:
            raise click.BadParameter(f"{name!r} is none of {', '.join(MEASURES)}")
    return names


@click.command(epilog="Measures: " + "; ".join(f"{name}: {measure.line}" for name, measure in MEASURES.items()) + ".")
@click.option(
    "--only", multiple=True, metavar="NAME,NAME", callback=_measures, help="Measure these alone; may be given again."
)
@click.option("--repeats", type=click.IntRange(1, 1000), default=5, show_default=True, help="Runs behind each median.")
@click.option("--plant-c", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="Another C plant.")
@click.option(
    "--ocean-cases", type=click.Path(exists=True, file_okay=False, path_type=Path), metavar="DIR",
    help="Cases of ocean gliders in folders of DIR, for `ocean`.",
)  # fmt: skip
@json_option
def benchmark(only: list[str], repeats: int, plant_c: Path | None, ocean_cases: Path | None, as_json: bool) -> None:
    """Measure how fast this machine flies: medians of repeated runs, what is compared taken in turns."""
    results = run(only or list(MEASURES), Settings(repeats, plant_c, ocean_cases), lambda name: say(f"{name} ..."))
    if as_json:
        print_json(results)
        return
    for name, figures in results.items():
        for figure, value in figures.items():
            click.echo(f"{name + '.' + figure:<28} {_shown(value)}")
