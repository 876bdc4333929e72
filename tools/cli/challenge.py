"""`glider gap challenge`: a blind test of the diagnosis, made, run and scored."""

from pathlib import Path

import click

from tools.cli.common import fail, progress, say

folder = click.Path(path_type=Path, file_okay=False)


@click.group()
def challenge():
    """A blind test: sealed cases with unknown effects, and the score of answers to them."""


@challenge.command()
@click.option("--out", required=True, type=folder, help="Folder for cases, held, answers.zip and manifest.json.")
@click.option("--seed", required=True, type=click.IntRange(0, 2**63 - 1), help="All cases follow from it.")
@click.option("--single", default=100, show_default=True, type=click.IntRange(0, 1000), help="Cases with one effect.")
@click.option("--none", "none", default=60, show_default=True, type=click.IntRange(0, 1000), help="Without a gap.")
@click.option("--pairs", default=30, show_default=True, type=click.IntRange(0, 1000), help="With two effects.")
@click.option("--unknown", default=30, show_default=True, type=click.IntRange(0, 1000), help="Outside the catalogue.")
@click.option("--answers", type=click.Path(path_type=Path, dir_okay=False), help="Where the sealed answers go.")
@click.option("--jobs", default=0, type=click.IntRange(0, 256), help="Processes; one a core by default.")
def make(
    out: Path, seed: int, single: int, none: int, pairs: int, unknown: int, answers: Path | None, jobs: int
) -> None:
    """Draw, fly and seal a blind test. Cases that are there are kept: call again to go on after a stop."""
    from tools.challenge.make import Order
    from tools.challenge.make import make as make_all
    from tools.challenge.plan import Counts
    from tools.challenge.seal import ARCHIVE, MANIFEST, read_manifest

    counts = Counts(single, none, pairs, unknown)
    total = single + none + pairs + unknown
    if not total:
        raise click.UsageError("no cases: all counts are 0")
    order = Order(out, seed, counts, answers or out / ARCHIVE)
    with progress("cases", total) as advance:
        made, wrong = make_all(order, jobs, advance)
    if wrong:
        fail("\n".join([*wrong, "nothing sealed: take another seed, or other counts"]))
    say(f"{made} cases made, {total - made} were there: {out}")
    say(f"SHA-256 of {order.archive}: {read_manifest(out / MANIFEST)['answers']['sha256']}")
