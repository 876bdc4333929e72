"""`glider export`: cases in the formats of others."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_lines, say
from glider.tools.data.errors import need
from glider.tools.data.files import check_writable, write_bytes


@click.group("export")
def export() -> None:
    """Write a case in a format that others read."""


@export.command("og1")
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="NetCDF file to write.")
@click.option(
    "--with", "answers", multiple=True, metavar="DIR", type=click.Path(path_type=Path),
    help="Folder of `gap velocity`, `watch` or `diagnose`: its answer goes into the file. Several may be given.",
)  # fmt: skip
@click.option("--contributor", default="unknown", help="Name of the principal investigator.")
@click.option("--email", default="unknown", help="E-mail address of the principal investigator.")
@click.option("--institution", default="unknown", help="Institution that operates the glider.")
@click.option("--wmo", default="unknown", help="WMO identifier of the glider.")
@click.option(
    "--data-mode", type=click.Choice(["R", "P", "A", "D", "M"]), default="R", show_default=True,
    help="Real time, provisional, adjusted, delayed, or mixed.",
)  # fmt: skip
@json_option
def og1(
    case: Path, out: Path, answers: tuple[Path, ...], contributor: str, email: str, institution: str, wmo: str,
    data_mode: str, as_json: bool,
) -> None:  # fmt: skip
    """Write an ocean glider's case as a mission in OceanGliders' common format (OG-1.0)."""
    need("ocean")
    check_writable(out.parent)
    from glider.tools.data.exporters.og1 import MissionAttributes, export_og1

    about = MissionAttributes(contributor, email, institution, wmo, data_mode)
    found = export_og1(case, out, list(answers), about)
    for one in found:
        say(f"{one.name}: {one.long_name}")
    if about.missing:
        say(f"note: 'unknown' in the file, which the format wants: {', '.join(f'--{one}' for one in about.missing)}")
    print_lines([out], as_json, {"case": str(case), "file": str(out), "variables": [one.name for one in found]})


@export.command("parquet")
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the files.")
@json_option
def parquet(case: Path, out: Path, as_json: bool) -> None:
    """Write the runs of CASE as Parquet, a file a run."""
    from glider.tools.data.exporters.parquet import export_parquet

    check_writable(out)
    files = export_parquet(case, out)
    print_lines(files, as_json, {"case": str(case), "files": [str(file) for file in files]})


file_argument = click.argument("file", metavar="FILE")
text_option = click.option(
    "--out", type=click.Path(path_type=Path, dir_okay=False), help="File to write.  [default: standard output]"
)
form_option = click.option(
    "--as", "form", type=click.Choice(["json", "python", "toml"]), default="json", show_default=True, help="Format."
)
speed_option = click.option(
    "--speed", type=click.FloatRange(0.01, 5.0), default=0.3, show_default=True,
    help="Speed at which the damping is linear, m/s.",
)  # fmt: skip


def _write(text: str, out: Path | None) -> None:
    """A text on standard output, or into a file that is said."""
    if out is None:
        click.echo(text, nl=False)
        return
    check_writable(out.parent)
    write_bytes(out, text.encode("utf-8"))
    say(f"written: {out}")


def _say_left_out(labels: list[str]) -> None:
    if labels:
        say(f"note: not in these numbers: {', '.join(labels)}")


@export.command("parameters")
@file_argument
@form_option
@text_option
def parameters(file: str, form: str, out: Path | None) -> None:
    """Write the numbers of FILE, a vehicle or a corrected.toml, with their units and standard deviations."""
    from glider.tools.inference.numbers_out import as_text, load_numbers

    _write(as_text(load_numbers(file).plain(), form, "VEHICLE"), out)


@export.command("fossen")
@file_argument
@speed_option
@form_option
@text_option
def fossen(file: str, speed: float, form: str, out: Path | None) -> None:
    """Write FILE, a vehicle or a corrected.toml, as matrices in Fossen's notation: M, parameters of C, D."""
    from glider.tools.inference.numbers_out import as_text, load_numbers
    from glider.tools.inference.simulators import fossen as table_of

    table = table_of(load_numbers(file), speed)
    _say_left_out(table["left_out"])
    _write(as_text(table, form, "FOSSEN"), out)


@export.command("sdf")
@file_argument
@speed_option
@text_option
def sdf(file: str, speed: float, out: Path | None) -> None:
    """Write FILE, a vehicle or a corrected.toml, for Gazebo: inertia, added mass and the hydrodynamics plugin (SDF)."""
    from glider.tools.inference.numbers_out import load_numbers
    from glider.tools.inference.simulators import left_out
    from glider.tools.inference.simulators import sdf as model_of

    numbers = load_numbers(file)
    text = model_of(numbers, speed)
    _say_left_out(left_out(numbers))
    _write(text, out)


@export.command("stonefish")
@file_argument
@click.option("--area", type=click.FloatRange(1e-6, 100.0), help="Area along x, m2, that Stonefish's drag refers to.")
@click.option("--density", type=click.FloatRange(900.0, 1300.0), default=998.0, show_default=True, help="kg/m3.")
@text_option
def stonefish(file: str, area: float | None, density: float, out: Path | None) -> None:
    """Write FILE, a vehicle or a corrected.toml, for Stonefish: mass, inertia, centre of mass, drag (XML)."""
    from glider.tools.inference.numbers_out import load_numbers
    from glider.tools.inference.simulators import left_out
    from glider.tools.inference.simulators import stonefish as body_of

    numbers = load_numbers(file)
    text = body_of(numbers, area, density)
    _say_left_out(left_out(numbers))
    if area is None:
        say("note: no drag without --area")
    _write(text, out)
