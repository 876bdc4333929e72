"""`python -m glider.tools.verify.figures.codecs`: damaged bytes through every codec
(tools/verify/faults/damaged_streams.py); prints their outcomes as JSON."""

import random
from dataclasses import asdict

import click

from glider.tools.cli.common import FAILED, print_json, progress
from glider.tools.verify.faults.damaged_streams import codecs, run_codec

BYTES = 10_000_000


@click.command()
@click.option("--bytes", "total", default=BYTES, show_default=True, help="Bytes of damage for each codec.")
@click.option("--seed", default=0, show_default=True)
def main(total: int, seed: int) -> None:
    """Feed random and mutated bytes to every codec; exit code 1 if one fails."""
    outcomes = []
    chosen = codecs()
    with progress("bytes", total * len(chosen)) as advance:
        for codec in chosen:
            outcomes.append(run_codec(codec, total, random.Random(f"{seed} {codec.name}"), advance))
    print_json([{**asdict(outcome), "pass": outcome.passed} for outcome in outcomes])
    raise SystemExit(0 if all(outcome.passed for outcome in outcomes) else FAILED)


if __name__ == "__main__":
    main()
