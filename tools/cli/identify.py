"""`glider identify`: parameters and their distribution from runs."""

import sys
from pathlib import Path

import click

from glider.tools.cli import own
from glider.tools.cli.common import json_option, print_json, say, vehicle_option


@click.command()
@click.argument("cases", metavar="CASE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder for vehicle file and report.")
@click.option("--seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="Of the chains.")
@click.option(
    "--likelihood", type=click.Choice(["flights", "accelerations"]), default="flights", show_default=True,
    help="Flights held to the recordings, or the paper's: equation (1) along smoothed motion capture.",
)  # fmt: skip
@vehicle_option
@json_option
def identify(
    cases: tuple[Path, ...], out: Path | None, seed: int, likelihood: str, vehicle: str | None, as_json: bool
) -> None:
    """Identify the vehicle of CASE from its runs: the twelve coefficients and their distribution, by MCMC.

    Runs that cannot be fitted are named and left out. What is handed out flies runs that its fit has not seen no worse
    than the file does. With --out: identified.toml (a vehicle file that says where it comes from), report.html,
    posterior.nc (ArviZ). A model of one's own takes several cases, each a session of its own.
    """
    from glider.sim_backend.ocean.vehicle import OceanVehicle
    from glider.tools.data.errors import need
    from glider.tools.data.files import check_writable
    from glider.tools.data.runs.case import load_case

    if out is not None:
        check_writable(out)
    if (theirs := own.own_vehicle(cases[0], vehicle)) is not None:
        own.identify(theirs, cases, out, as_json)
        return
    if len(cases) > 1:
        raise click.UsageError("several cases are for a model of one's own; this vehicle takes one")
    loaded = load_case(cases[0], vehicle, leave_out=True)
    if isinstance(loaded.vehicle, OceanVehicle):
        need("analysis")
        _identify_ocean(loaded, out, as_json)
        return
    need("identify")
    from glider.tools.identify.pipeline import identify as run_identification

    found = run_identification(loaded, seed, likelihood, lambda text: print(text, file=sys.stderr))
    for one in found.left_out:
        say(f"left out: {one}")
    for note in found.notes:
        say(note)
    if out is not None:
        from glider.tools.identify.files import VEHICLE, write
        from glider.tools.report.identified import write_report

        write(found, out)
        write_report(out / "report.html", found)
        say(f"vehicle: {out / VEHICLE}, report: {out / 'report.html'}")
    if as_json:
        print_json(found.plain())
    else:
        _tell(found)


def _identify_ocean(case, out: Path | None, as_json: bool) -> None:
    """The same of an ocean glider: no chains, its posterior is close to normal (docs/OCEAN.md, Identification)."""
    from glider.tools.identify.ocean.files import VEHICLE, plain, write
    from glider.tools.identify.ocean.identify import identify_ocean

    found = identify_ocean(case, lambda text: print(text, file=sys.stderr))
    for one in found.left_out:
        say(f"left out: {one}")
    if out is not None:
        write(found, out)
        say(f"vehicle: {out / VEHICLE}")
    if as_json:
        print_json(plain(found))
        return
    click.echo(f"{'':<18} {'mean':>11} {'sd':>9}   {'90 % interval':<24} unit")
    for number in [*found.parameters, found.net_mass]:
        low, high = number.ci90
        interval = f"{low:.5g} to {high:.5g}"
        click.echo(f"{number.name:<18} {number.mean:>11.5g} {number.sd:>9.2g}   {interval:<24} {number.unit}")
    for finding in found.findings:
        click.echo(finding.sentence)
    for weak_direction in found.ridges:
        click.echo(weak_direction.sentence())
    if found.next_run is not None:
        click.echo(f"to part them: {found.next_run['text']}")
    click.echo(f"vertical water {100.0 * found.water_rms:.2f} cm/s rms over {len(found.water)} runs")


def _tell(found) -> None:
    """The coefficients, and what the runs cannot tell, for a person."""
    from glider.tools.identify.identifiability import sentences, unidentifiable_directions

    if found.held is not None:
        before, after = found.held.candidates[0].total, found.held.chosen.total
        click.echo(
            f"runs left out: {before:.2f} -> {after:.2f} tolerances, worst in {found.held.worst}; handed out: "
            f"{found.held.chosen.name} ({found.held.why})"
        )
    click.echo(f"{'':<6} {'mean':>10} {'sd':>9}   {'90 % interval':<22} {'R-hat':>6} {'ESS':>7}  unit")
    for one in found.coefficients:
        low, high = one.ci90
        interval = f"{low:.4g} to {high:.4g}"
        figures = f"{one.name:<6} {one.mean:>10.4g} {one.sd:>9.2g}   {interval:<22}"
        click.echo(f"{figures} {one.rhat:>6.3f} {one.ess:>7.0f}  {one.unit}")
    for line in sentences(found.free, found.chains.flat):
        click.echo(line)
    for combination in unidentifiable_directions(found.free, found.chains.flat):
        click.echo(f"  {combination.sentence()}")
