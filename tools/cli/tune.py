"""`glider tune`: gains of the pitch and depth PID, by rule or by search, with the margins of the loops."""

import math
from typing import TYPE_CHECKING, Any

import click

from glider.tools.cli.common import compile_campaign, json_option, print_json, progress
from glider.tools.data.errors import need

if TYPE_CHECKING:
    from glider.firmware.model.gains import Control
    from glider.tools.study.tuning.rule import Row

BUDGET = 180  # candidates a loop


@click.command()
@click.option("--vehicle", default="roughie", show_default=True, help="Vehicle: shipped name or file.")
@click.option("--method", type=click.Choice(["rule", "search"]), default="rule", show_default=True)
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Seed of the search.")
@click.option("--budget", default=BUDGET, show_default=True, type=click.IntRange(6), help="Gains tried in each loop.")
@json_option
def tune(vehicle: str, method: str, seed: int, budget: int, as_json: bool) -> None:
    """Tune the pitch and depth PID of a vehicle.

    By rule: 60 degrees of phase margin at a stated crossover. By search: the gains that track the paper's manoeuvres
    best under noise, with the rule's beside them; takes minutes. Both end with a [control] table to paste into a
    vehicle or mission file. The reference filters stay as the vehicle has them.
    """
    need("analysis")
    from glider.hal.strict import decode
    from glider.sim_backend.board import SimBoardFile
    from glider.tools.data.boards import load_board_file
    from glider.tools.data.sources import load_vehicle
    from glider.tools.study.tuning import rule, search

    the_vehicle, file = load_vehicle(vehicle), load_board_file("sim")
    board = decode(file.text, SimBoardFile, file.source)
    control = ruled = rule.tune(the_vehicle, board)
    result: dict[str, Any] = {"method": method, "vehicle": the_vehicle.name}
    if method == "search":
        compile_campaign()
        with progress("gains tried", 2 * budget) as advance:
            control, found = search.search(the_vehicle, ruled, seed, budget, advance)
        result["seed"] = seed
        result["search"] = {
            loop: {"cost": one.cost, "cost_of_rule": one.cost_before, "candidates": one.candidates}
            for loop, one in found.items()
        }
        result["tracking"] = search.report(the_vehicle, {"rule": ruled, "search": control})
    result["gains"] = {
        "pitch": {name: getattr(control.pitch, name) for name in ("kp", "ki", "kd")},
        "depth": {name: getattr(control.depth, name) for name in ("kp", "ki", "kd", "rate_bandwidth")},
    }
    result["margins"] = [_margins(row) for row in rule.table(the_vehicle, board, control)]
    result["toml"] = toml(control)
    if as_json:
        print_json(result)
    else:
        _tell(result)


def _margins(row: "Row") -> dict[str, Any]:
    """A row of margins under its JSON names."""
    trim, found = row.trim, row.margins
    return {
        "loop": row.loop, "trim": trim.name, "pitch_deg": math.degrees(trim.pitch), "ballast_kg": trim.ballast,
        "design": row.design, "crossover_rad_s": found.crossover, "phase_margin_deg": found.phase,
        "gain_margin": found.gain, "gain_margin_down": found.gain_down, "delay_margin_s": found.delay,
        "sensitivity_peak": found.peak,
    }  # fmt: skip


def toml(control: "Control") -> str:
    """The [control] tables of the two loops, to paste."""
    lines = []
    for loop in ("pitch", "depth"):
        table = getattr(control, loop)
        lines += [f"[control.{loop}]", *(f"{name} = {getattr(table, name)}" for name in ("kp", "ki", "kd"))]
        if loop == "depth":
            lines.append(f"rate_bandwidth = {table.rate_bandwidth}")
        lines += [f"reference = {{ wn = {table.reference.wn}, zeta = {table.reference.zeta} }}", ""]
    return "\n".join(lines)


def _decibel(factor: float) -> str:
    return f"{20.0 * math.log10(factor):6.1f}" if 0.0 < factor < math.inf else "   inf"


def _tell(result: dict[str, Any]) -> None:
    """Margins, errors and the table to paste, for a person."""
    say = click.echo
    for loop, unit in (("pitch", "slider m by rad"), ("depth", "ballast kg by m")):
        gains = ", ".join(f"{name} {value:g}" for name, value in result["gains"][loop].items())
        say(f"{loop} ({unit}): {gains}")
        say("  trim            crossover  phase   gain  delay  peak of")
        say("                      rad/s    deg     dB      s  1/(1+L)")
        for row in (row for row in result["margins"] if row["loop"] == loop):
            say(
                f"  {row['trim']:<13} {'*' if row['design'] else ' '} {row['crossover_rad_s']:9.2f} "
                f"{row['phase_margin_deg']:6.1f} {_decibel(row['gain_margin'])} {row['delay_margin_s']:6.2f} "
                f"{row['sensitivity_peak']:8.2f}"
            )
        say()
    say("* the rule's own trims, ballast 0.1 kg; margins on samples as they come, without the Kalman filter\n")
    if "tracking" in result:
        say("tracking error, percent of the target, and actuators' ways a minute, on flights the search has not seen")
        say("  loop   gains    noise  error %  slider m  ballast kg")
        for row in result["tracking"]:
            say(
                f"  {row['loop']:<6} {row['gains']:<7} {row['noise']:6g} {row['tracking_error_pct']:8.2f} "
                f"{row['slider_m_per_min']:9.3f} {row['ballast_kg_per_min']:11.3f}"
            )
        say()
    say(result["toml"])
