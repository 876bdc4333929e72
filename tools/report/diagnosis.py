"""The report of a diagnosis: one HTML file that opens offline, on a phone too (docs/DIAGNOSIS.md)."""

import math
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from sim_backend.effects.catalogue import catalogue
from tools.diagnose import doubt
from tools.diagnose import verdict as rules
from tools.diagnose.chain import Link, by_effects, calm, links, ordered, scatter, shared_out
from tools.diagnose.diagnosis import CORRECTION_FILE, Diagnosis, parameters, places
from tools.diagnose.probes import CLOCK, UNPREDICTABLE
from tools.diagnose.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED
from tools.diagnose.verdict import drop
from tools.inference.channels import CHANNELS, channels_of, measured
from tools.inference.windows import windows
from tools.report import words
from tools.report.chain_picture import chain_svg
from tools.report.charts import Chart, Line, svg
from tools.report.lines import bands, broken, near, unwrapped
from tools.report.page import render

SHOWN_RUNS = 2  # with the largest gaps
SHOWN = ("depth", "pitch", "roll", "yaw", "xy")
LEAST, MOST_RANKED = 0.005, 8  # of the ranking
LEAST_SHARE, MOST_LINKS = 0.01, 7  # of the links
PANELS = 2  # of links: one for each effect, the first ones
SHORT = {"force and moment": "force"}
MOST_LEFT = 8  # channels in which something is left


def _panel(title: str, found: list[Link]) -> dict[str, Any]:
    """A list of links with their shares, largest first within what is shown, in the order of the chain."""
    largest = sorted(found, key=lambda link: -link.share)[:MOST_LINKS]
    kept = [link for link in found if link in largest and link.share >= LEAST_SHARE]
    rows = [
        {"stage": SHORT.get(link.stage, link.stage), "name": link.name, "percent": 100.0 * link.share} for link in kept
    ]
    return {"title": title, "rows": rows}


def _panels(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The chain's links freed, one panel for each effect; for an unknown gap what is left, for none nothing."""
    answer, search = diagnosis.answer, diagnosis.search
    if diagnosis.verdict == "none":
        return []
    if diagnosis.verdict == "unknown" and answer.freed:
        beyond = f" beyond {words.joined(answer.selected)}" if answer.selected else ""
        return [_panel(f"Of what is left{beyond}", shared_out(answer.freed, 0.0))]
    fitted = [label for label in answer.selected if label in answer.course.labels][:PANELS]
    water = answer.noise is not None and answer.noise.probe.name != CLOCK
    if water or not fitted:
        seen = calm(search) if water else search
        return [_panel("Of what the likeliest link brings", links(seen, search.null, search.null))]
    panels = []
    for label in fitted:
        without = drop(search, answer.course, label)
        found = links(search, without, answer.course) + by_effects(search, without, answer.course, label)
        panels.append(_panel(f"Of what {label} brings", ordered(found)))
    return panels


def _ranking(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    ranked = sorted(diagnosis.answer.probabilities.items(), key=lambda item: -item[1])
    effects = catalogue()
    return [
        {
            "label": label,
            "place": words.place(label) if label in effects else "",
            "means": words.MEANS.get(label) or words.PLAIN[label],
            "percent": 100.0 * p,
            "shown": words.small_percent(p),
        }
        for n, (label, p) in enumerate(ranked)
        if n < MOST_RANKED and (p >= LEAST or n < 3)
    ]


def _effects(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The selected effects: what they mean, and their parameters with 90 % intervals."""
    if diagnosis.verdict == "none":
        return []
    found = []
    for label in diagnosis.answer.selected:
        rows = []
        for name, entry in parameters(diagnosis, label).items():
            mass = catalogue()[label].subsystem in ("mass", "actuation")
            values = [float(entry["estimate"]), *map(float, entry["ci90"])]
            values, unit = words.scaled(values, entry["unit"], mass)
            rows.append(
                {
                    "name": name,
                    "unit": unit,
                    **dict(zip(("value", "low", "high"), map(words.number, values), strict=True)),
                }
            )
        nat = diagnosis.answer.gained.get(label)
        found.append({
            "label": label, "place": words.place(label), "plain": words.upper(words.PLAIN[label]),
            "summary": catalogue()[label].summary, "rows": rows, "nat": None if nat is None else words.nats(float(nat)),
        })  # fmt: skip
    return found


def _scatter(diagnosis: Diagnosis) -> dict[str, str] | None:
    noise = diagnosis.answer.noise
    if noise is None or noise.probe.name == CLOCK:
        return None
    found = scatter(diagnosis.search, diagnosis.search.null)
    return {"name": noise.probe.name, "calm": words.number(found.calm), "rough": words.number(found.rough)}


def _pictures(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The runs with the largest gaps before: measured, nominal and corrected."""
    totals = [gap.total for gap in diagnosis.shrinkage.runs[BEFORE]]
    order = sorted(range(len(totals)), key=lambda n: -np.nan_to_num(totals[n]))[:SHOWN_RUNS]
    after = diagnosis.shrinkage.runs[AFTER]
    return [
        {
            "name": diagnosis.case.runs[n].name, "before": words.number(totals[n]),
            "after": words.number(after[n].total), "charts": _charts(diagnosis, n),
        }
        for n in sorted(order)
    ]  # fmt: skip


def _charts(diagnosis: Diagnosis, n: int) -> list[dict[str, Any]]:
    run, shrinkage = diagnosis.case.runs[n], diagnosis.shrinkage
    table, t, listed = measured(run), run.t, windows(run.t)
    said = {"nominal": shrinkage.predictions[BEFORE][n], "corrected": shrinkage.predictions[AFTER][n]}
    drawn = []
    for channel in channels_of(run):
        if channel.name not in SHOWN:
            continue
        if channel.joint:
            north, east = channel.columns
            lines = [Line(table[:, east], table[:, north], "measured")]
            lines += [broken(Y[:, east], Y[:, north], listed, style) for style, Y in said.items()]
            chart, least = Chart("plan, north up, m", "east", lines, square=True), 1.0
        else:
            column, scale = channel.columns[0], channel.scale
            seen = unwrapped(table[:, column]) if channel.wrapped else table[:, column]
            lines = [Line(t, seen * scale, "measured")]
            for style, Y in said.items():
                values = near(t, seen, Y[:, column]) if channel.wrapped else Y[:, column]
                lines.append(broken(t, values * scale, listed, style))
            chart = Chart(f"{channel.name}, {channel.unit}", "s", lines, bands(t, listed), down=channel.name == "depth")
            least = 4.0 * channel.tolerance * scale
        gaps = [
            words.number(shrinkage.runs[which][n].channels.get(channel.name, math.nan)) for which in (BEFORE, AFTER)
        ]
        drawn.append({"title": chart.title, "before": gaps[0], "after": gaps[1], "svg": svg(chart, least)})
    return drawn


def _table(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Channels, then the total, by the four models."""
    found = {which: diagnosis.shrinkage.channels(which) for which in (BEFORE, RECALIBRATED, AFTER, FLOOR)}
    return [
        {
            "name": name,
            "cells": [f"{found[which].get(name, math.nan):.2f}".replace("nan", words.DASH) for which in found],
        }
        for name in found[BEFORE]
    ]


def _groups(diagnosis: Diagnosis) -> list[str]:
    """Labels that these data cannot tell apart, of those that matter."""
    answer = diagnosis.answer
    said = []
    for label in [answer.main, *answer.selected]:
        group = sorted(answer.groups.get(label, []))
        if len(group) > 1 and words.joined(group) not in said:
            said.append(words.joined(group))
    return said


def _data(diagnosis: Diagnosis) -> dict[str, Any]:
    case = diagnosis.case
    seconds = [float(run.t[-1] - run.t[0]) for run in case.runs]
    columns = sorted({name for run in case.runs for name, values in run.columns.items() if np.isfinite(values).any()})
    return {
        "case": case.folder.resolve().name, "vehicle": case.vehicle.name, "site": case.site, "runs": len(case.runs),
        "seconds": f"{sum(seconds):.0f}", "rate": f"{case.log_rate_hz:g}", "columns": columns,
        "mocap": case.motion_capture,
    }  # fmt: skip


def _correction(diagnosis: Diagnosis) -> dict[str, str] | None:
    """What a data-driven correction of an unknown gap is like, and does."""
    found, further = diagnosis.correction, diagnosis.further
    if found is None or further is None:
        return None
    shapes = [f"{name} ({words.quantity(rms, found.unit)} rms)" for name, rms in found.carried.items()]
    return {
        "link": found.link, "shapes": words.joined(shapes), "file": CORRECTION_FILE,
        "far": f"{words.change(further.shrinkage)} ({words.interval(*further.ci90)})",
        "after": words.number(further.after),
    }  # fmt: skip


def _version() -> str:
    try:
        return version("glider")
    except PackageNotFoundError:
        return "not installed"


def _context(diagnosis: Diagnosis) -> dict[str, Any]:
    answer, s = diagnosis.answer, diagnosis.shrinkage
    effects = catalogue()
    others = [label for label in answer.selected if label != answer.main and diagnosis.verdict == "cause"]
    certain = [(effects[label].subsystem, effects[label].element) for label in others]
    none = diagnosis.verdict == "none"
    left = words.described(diagnosis)
    recorded = {name for run in diagnosis.case.runs for name in (c.name for c in channels_of(run))}
    strongest = max((abs(f.sigma) for f in answer.findings), default=0.0)
    return {
        "data": _data(diagnosis),
        "verdict": diagnosis.verdict,
        "sentence": words.sentence(diagnosis),
        "chain": chain_svg([] if none else places(answer), certain, diagnosis.verdict == "unknown"),
        "panels": _panels(diagnosis),
        "ranking": _ranking(diagnosis),
        "effects": _effects(diagnosis),
        "scatter": _scatter(diagnosis),
        "pictures": _pictures(diagnosis),
        "corrected": "corrected" if answer.course.labels and not none else "recalibrated",
        "table": _table(diagnosis),
        "shrinkage": f"{words.percent(s.shrinkage)} ({words.interval(*s.ci90)})",
        "closed": f"{words.percent(s.closed)} ({words.interval(*s.closed_ci90)})",
        "alone": words.alone(s),
        "predictable": answer.main not in UNPREDICTABLE,
        "tolerances": [f"{c.name} {c.tolerance * c.scale:g} {c.unit}" for c in CHANNELS if c.name in recorded],
        "groups": _groups(diagnosis),
        "cautions": [words.upper(line) for line in diagnosis.cautions],
        "correction": _correction(diagnosis),
        "left": left[:MOST_LEFT],
        "left_more": max(0, len(left) - MOST_LEFT),
        "tests": len(answer.findings),
        "strongest": words.number(float(strongest)),
        "next_run": diagnosis.next_run,
        "version": _version(),
        "rules": rules,
        "doubt": doubt,
    }


def report_html(diagnosis: Diagnosis) -> str:
    """The page's text; MissingExtra without jinja2."""
    return render("diagnosis.html", _context(diagnosis)).replace(" %", "\N{NO-BREAK SPACE}%")


def write_report(path: Path, diagnosis: Diagnosis) -> None:
    """Write the page to a file."""
    path.write_text(report_html(diagnosis), encoding="utf-8")
