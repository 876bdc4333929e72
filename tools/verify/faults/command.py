"""`glider faults`: the fault campaign."""

import os

import click

from glider.tools.cli.common import DONE, FAILED, json_option, print_json, progress


def _row(context: click.Context, option: click.Parameter, row: int | None) -> int | None:
    """Refuse a number that is no row of the fault table; the table is imported only where a row was given."""
    if row is not None:
        from glider.firmware.faults import FAULTS

        if row not in FAULTS:
            raise click.BadParameter(f"there is no row {row}; rows are {min(FAULTS)} to {max(FAULTS)}.")
    return row


@click.command()
@click.option("--only", type=int, callback=_row, metavar="ROW", help="This row of the fault table alone.")
@click.option("--disable-detector", "disabled", type=int, callback=_row, metavar="ROW",
              help="Switch off what notices this row: it has to fail.")  # fmt: skip
@click.option("--workers", default=max(1, os.cpu_count() or 1), type=click.IntRange(1, 256), help="Processes at once.")
@json_option
def faults(only: int | None, disabled: int | None, workers: int, as_json: bool) -> None:
    """Put every fault of the fault table into flights, in every phase that fits, and see what comes of it.

    A row passes if each of its cases is noticed within its time and two ticks, causes the reaction expected, and ends
    at the surface or safe. Exit code 1: a row failed.
    """
    from glider.tools.verify.faults.campaign import jobs, run_all, summary

    with progress("faults", len(jobs(only))) as advance:
        result = summary(list(run_all(only, disabled, workers, advance)))
    if as_json:
        print_json(result)
    else:
        _tell(result)
    raise SystemExit(DONE if result["failed"] == 0 else FAILED)


def _tell(result: dict) -> None:
    for row in result["faults"]:
        noticed = "never" if row["noticed_s"] is None else f"{row['noticed_s']:.2f}"
        word = "ok  " if row["pass"] else "FAIL"
        click.echo(
            f"{word} {row['number']:>2}  {row['name']:<52} {noticed:>7} of {row['allowed_s']:.2f} s  {row['ended']}"
        )
        for case in row["cases"]:
            if not case["pass"]:
                seen = "never noticed" if case["noticed_s"] is None else f"noticed after {case['noticed_s']:.2f} s"
                click.echo(
                    f"         {case['case']} ({case['phase']}): {seen}, {case['reaction']} for {case['expected']}, "
                    f"{case['ended']}"
                )
    click.echo(
        f"{result['passed']} rows passed, {result['failed']} failed; {result['cases']} cases, "
        f"{result['neither_surfaced_nor_safe']} ended neither surfaced nor safe"
    )
