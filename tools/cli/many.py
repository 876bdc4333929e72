"""What commands on cases have for several of them: options, and the work here or on a cluster with one bar."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import fail, print_json, progress, say
from glider.tools.data.errors import need

jobs_option = click.option(
    "--jobs", type=click.IntRange(0, 256), help="Cases at a time, each in a process of its own: 1; 0: one a core."
)
dask_option = click.option("--dask", metavar="ADDRESS", help="On this Dask cluster: tcp://HOST:PORT of its scheduler.")
again_option = click.option("--again", is_flag=True, help="Cases that have their answer too; else they are kept.")


def cases_argument(command: Callable[..., Any]) -> Callable[..., Any]:
    """CASE..., --jobs, --dask and --again."""
    several = click.argument("cases", metavar="CASE...", nargs=-1, required=True, type=click.Path(path_type=Path))
    return several(jobs_option(dask_option(again_option(command))))


def need_for(jobs: int | None, dask: str | None) -> None:
    """MissingExtra where something is missing that work here or on a cluster takes."""
    need("analysis")
    if dask or jobs not in (None, 1):
        need("campaign")


def is_many(cases: Sequence[Path], jobs: int | None, dask: str | None, again: bool) -> bool:
    """Whether a folder a case is asked for: one case alone, without these options, has its answer in DIR itself."""
    return len(cases) > 1 or jobs is not None or dask is not None or again


def run_batch_command(
    cases: Sequence[Path], out: Path | None, asked: Any, jobs: int | None, dask: str | None, again: bool, as_json: bool,
) -> None:  # fmt: skip
    """Ask many cases by a many_cases.OneCommand; failures are reported, and exit code 1."""
    from glider.tools.cli.many_cases import Many, run_batch

    if out is None:
        raise click.UsageError("several cases need --out, a folder of their answers")
    need_for(jobs, dask)
    many = Many(cases, out, asked.answer, 1 if jobs is None else jobs, dask, again)
    with progress("answered", len(cases)) as advance:
        done, wrong = run_batch(many, asked, advance=advance)
    if as_json:
        print_json({"cases": _answers(many), "failed": wrong})
    kept = len(cases) - done - len(wrong)
    say(f"{done} answered{f', {kept} were there' if kept else ''}: {out}/<case>/{asked.answer}")
    if wrong:
        fail("\n".join(wrong))


def _answers(many: Any) -> dict[str, Any]:
    """Every answer that is there, by case."""
    import json

    files = {case.resolve().name: many.out / case.resolve().name / many.answer for case in many.cases}
    return {name: json.loads(file.read_text(encoding="utf-8")) for name, file in files.items() if file.is_file()}
