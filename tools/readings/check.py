"""All checks of the readings of a case, in their order, and the runs with the corrected readings.

Rates are corrected before the heading is compared with them, motion capture's clock before anything is compared with
it.
No vehicle file is read: columns and units are enough.
"""

from dataclasses import dataclass, replace

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.readings.capture import advanced, judge_capture
from glider.tools.readings.findings import WHOLE, Finding
from glider.tools.readings.heading import judge_heading
from glider.tools.readings.pairs import said, weigh
from glider.tools.readings.rates import judge_rates
from glider.tools.readings.samples import judge_clock, judge_samples
from glider.tools.readings.signals import SignalTable, table_of
from glider.tools.readings.stretches import flying, judge_stretches
from glider.tools.readings.surface import judge_surface

FINDINGS_ORDER = (
    "axes", "units", "sign", "scale", "offset", "delay", "drift", "goes_with", "saturated", "held", "not_flying",
)  # fmt: skip


@dataclass(frozen=True)
class Readings:
    """What was found, most telling first, and the runs as later stages should see them."""

    findings: list[Finding]
    runs: list[Run]


def check(runs: list[Run]) -> Readings:
    """The findings of a case's runs. InputError where there is nothing to compare."""
    compared = [name for name in names.ALL if any(_recorded(run, name) for run in runs) and name not in names.COMMANDS]
    if len(compared) < 3:  # time and one channel
        raise InputError(f"nothing to compare: {', '.join(compared[1:]) or 'no channel'} only")
    flies = [flying(run) for run in runs]
    samples = [*judge_samples(runs), *judge_clock(runs), *judge_stretches(runs)]
    if not any(state.any() for state in flies):
        return Readings(ordered(samples), runs)
    table = table_of(runs, flies)
    weighed = weigh(table)
    rates = judge_rates(table, weighed)
    if weighed is not None and not any(one.channel in weighed.fault.columns for one in rates if one.finding in WHOLE):
        rates = [*said(weighed), *rates]
    mended = apply_corrections(table, rates)
    found = [*rates, *judge_capture(mended), *judge_heading(mended), *judge_surface(runs), *samples]
    return Readings(ordered(found), corrected_runs(runs, apply_corrections(table, found)))


def disagreement(runs: list[Run]) -> list[str]:
    """Signs, units and axes alone that attitude, rates and depth disagree in, a sentence each; quick if none."""
    flies = [flying(run) for run in runs]
    weighed = weigh(table_of(runs, flies)) if any(state.any() for state in flies) else None
    return [] if weighed is None else [one.text for one in said(weighed)]


def ordered(findings: list[Finding]) -> list[Finding]:
    """By what is to be settled first."""
    return sorted(findings, key=lambda one: FINDINGS_ORDER.index(one.finding))


def _recorded(run: Run, name: str) -> bool:
    return name in run.columns and bool(np.isfinite(run.columns[name]).any())


def apply_corrections(table: SignalTable, findings: list[Finding]) -> SignalTable:
    """The table with what can be corrected."""
    columns = dict(table.columns)
    for one in findings:
        if not one.mended or one.channel not in columns:
            continue
        values, made = columns[one.channel], one.values
        if "offset" in made:
            values = values - made["offset"]
        if "gain" in made:
            values = values / made["gain"]
        if "from" in made:
            group = names.ATTITUDE if one.channel in names.ATTITUDE else names.RATES
            values = made["sign"] * table.columns[group[int(made["from"])]]
        if "depth_scale" in made:
            values = values / (1.0 + made["depth_scale"])
        if "pressure_lever" in made or "pitch" in made:
            lever = made.get("pressure_lever", made.get("pitch", 0.0))
            values = values + lever * np.sin(table.columns.get(names.ATTITUDE[1], np.zeros(len(values))))
        if "ballast_kg" in made:
            values = values - made["ballast_kg"] * table.columns["ballast_kg"]
        columns[one.channel] = values
    moved = replace(table, columns=columns)
    for one in findings:
        if one.finding == "delay" and one.mended:
            late = {"attitude": names.ATTITUDE, "mocap": names.MOCAP, names.DEPTH: (names.DEPTH,)}[one.channel]
            moved = advanced(moved, late, one.size)
    return moved


def corrected_runs(runs: list[Run], table: SignalTable) -> list[Run]:
    """The table's columns as runs again."""
    out = []
    for n, run in enumerate(runs):
        here = table.run == n
        columns = {name: table.columns[name][here] if name in table.columns else v for name, v in run.columns.items()}
        out.append(replace(run, columns=columns))
    return out
