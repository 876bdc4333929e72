"""`glider campaign`: many simulated flights at once, on all cores or on a Dask cluster."""

import signal
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import compile_campaign, json_option, print_json, print_lines, progress, say
from glider.tools.data.errors import InputError, need
from glider.tools.data.files import check_writable, write_bytes

PAIR: dict[str, Any] = {"nargs": 2, "type": float, "metavar": "LOW HIGH"}
# option -> key of the campaign file that it stands in for
KEYS = {
    "mission": "missions", "controller": "controllers", "vehicle": "vehicle", "seeds": "seeds",
    "first_seed": "first_seed", "spread": "spread.parameters", "bias": "spread.sensor_bias",
    "noise": "spread.sensor_noise", "current": "environment.current_m_s", "waves": "environment.wave_height_m",
    "period": "environment.wave_period_s", "disturbance": "environment.disturbance", "depth": "start.depth_m",
}  # fmt: skip


@click.command()
@click.argument("campaign", default="robustness", metavar="[CAMPAIGN]")
@click.option(
    "--design", type=click.Choice(["identification"]),
    help="Make run data instead: the paper's 45 captured runs of a vehicle drawn with --first-seed, for `identify`.",
)  # fmt: skip
@click.option("--mission", multiple=True, help="Mission: shipped name or file. Again for more.")
@click.option("--controller", multiple=True, help="A controller as in a mission file, or pid_tuned. Again for more.")
@click.option("--vehicle", help="Vehicle: shipped name or file.")
@click.option("--seeds", type=int, help="Worlds of each mission.")
@click.option("--first-seed", type=int, help="The first of them.")
@click.option("--spread", type=float, metavar="TIMES", help="Parameters drawn at this many times [uncertainty].")
@click.option("--bias", type=float, metavar="TIMES", help="Sensor biases, times the vehicle file's.")
@click.option("--noise", type=float, metavar="TIMES", help="Sensor noise, times the vehicle file's.")
@click.option("--current", type=float, metavar="M/S", help="Currents up to this, from anywhere.")
@click.option("--waves", type=float, metavar="M", help="Waves up to this, crest to trough, from anywhere.")
@click.option("--period", **PAIR, help="Periods of the waves, s.")
@click.option("--disturbance", **PAIR, help="Acceleration noise, m/s2 and rad/s2.")
@click.option("--depth", **PAIR, help="Depth at which flights begin, m.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the flights.  [default: NAME-campaign]")
@click.option("--jobs", type=click.IntRange(0, 4096), default=0, help="Processes.  [default: one a core]")
@click.option("--dask", metavar="ADDRESS", help="Fly on this Dask cluster instead: tcp://HOST:PORT of its scheduler.")
@click.option("--chunk", type=click.IntRange(1, 100_000), default=60, show_default=True, help="Flights a chunk.")
@json_option
def campaign(campaign, design, out, jobs, dask, chunk, as_json, **options) -> None:
    """Fly CAMPAIGN, a shipped name (robustness) or a file; options stand in for what it says.

    Every world is flown by every controller. Flights are kept in a folder as they are done: stopped by Ctrl-C or a
    power cut, the same command goes on where it was. Numbers do not depend on processes, chunks or cluster.
    """
    if design is not None:
        _make_runs(out or Path(f"{design}-runs"), options, as_json)
        return
    import msgspec

    need("campaign")
    from glider.tools.study.campaign.conduct import FLIGHTS_FILE, fly_campaign, write_flights
    from glider.tools.study.campaign.picture import write_page
    from glider.tools.study.campaign.plan import build_plan, load_campaign, with_options
    from glider.tools.study.campaign.summary import summarise

    wanted, base = load_campaign(campaign)
    given = {KEYS[name]: None if value == () else value for name, value in options.items()}
    wanted = with_options(wanted, given)
    plan = build_plan(wanted, base)
    folder = out or Path(f"{wanted.name}-campaign")
    check_writable(folder)
    compile_campaign()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # or its processes would outlive it
    try:
        with progress(f"campaign {wanted.name}", plan.flights) as advance:
            flown = fly_campaign(plan, folder, jobs=jobs, dask=dask, chunk=chunk, advance=advance)
    except KeyboardInterrupt:
        say(f"the same command goes on with what is in {folder}")
        raise click.Abort from None
    finally:
        signal.signal(signal.SIGTERM, before)
    write_flights(folder / FLIGHTS_FILE, flown)
    write_page(folder / "campaign.html", flown)
    result = {**summarise(flown), "folder": str(folder), "picture": str(folder / "campaign.html")}
    write_bytes(folder / "summary.json", msgspec.json.format(msgspec.json.encode(result), indent=1))
    if as_json:
        print_json(result)
    else:
        _tell(result)


def _make_runs(folder: Path, options: dict[str, Any], as_json: bool) -> None:
    """The identification design as a case; the truth goes beside it as truth.json."""
    import json

    from glider.tools.data.sources import load_vehicle
    from glider.tools.identify.design import grid, truth, write_design

    need("analysis")
    given = [
        name for name, value in options.items() if value not in (None, ()) and name not in ("vehicle", "first_seed")
    ]
    if given:
        raise InputError(f"--{given[0].replace('_', '-')} means nothing with --design", source="options")
    wanted, seed = options["vehicle"] or "roughie", options["first_seed"] or 0
    check_writable(folder)
    world = write_design(folder, wanted, load_vehicle(wanted), seed)
    write_bytes(folder / "truth.json", (json.dumps(truth(world), indent=1) + "\n").encode())
    print_lines([folder], as_json, {"case": str(folder), "runs": len(grid()), "seed": seed, "truth": truth(world)})


def _pair(found: dict, scale: float) -> str:
    return "-" if found["mean"] is None else f"{scale * found['mean']:.2f} / {scale * found['median']:.2f}"


def _tell(result: dict) -> None:
    """The table, for a person: controllers over all missions, then each mission where there are several."""
    several = len(result["by_mission"]) > len(result["controllers"])
    rows = result["controllers"] + (result["by_mission"] if several else [])
    line = "{:<10} {:<12} {:>7} {:>9}  {:<15} {:>15} {:>13} {:>7}  {}"
    click.echo(line.format("controller", "mission", "flights", "completed", "90 % interval", "depth error, cm",
                           "pitch, deg", "time, s", "why not"))  # fmt: skip
    for row in rows:
        low, high = (100.0 * end for end in row["completed_ci90"])
        seconds, why = row["seconds"]["mean"], (f"{name} {n}" for name, n in row["reasons"].items())
        click.echo(
            line.format(
                row["controller"], row["mission"], row["flights"], f"{100 * row['completed']:.1f} %",
                f"{low:.1f} to {high:.1f} %", _pair(row["depth_error_m"], 100.0), _pair(row["pitch_error_deg"], 1.0),
                "-" if seconds is None else f"{seconds:.1f}", ", ".join(why),
            ).rstrip()
        )  # fmt: skip
    click.echo(
        f"errors (mean / median) and times: over the {result['controllers'][0]['compared']} worlds of "
        f"{result['worlds']} that every controller completed"
    )
    if result["flown_now"]:
        say(f"{result['flown_now']} flights in {result['seconds']:.1f} s, {result['flights_per_s']:.1f} a second")
    say(f"picture: {result['picture']}")
