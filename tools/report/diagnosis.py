"""The report of a diagnosis, drawn from its folder: one HTML file that opens offline, on a phone too."""

from pathlib import Path
from typing import Any

import numpy as np

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.files import write_bytes
from glider.tools.data.runs.origin import with_flight
from glider.tools.diagnose.noise_probes import CLOCK, UNPREDICTABLE
from glider.tools.diagnose.record import Curves, DiagnosisRecord, Interval, Panel, Picture, number, read_record
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.report import words
from glider.tools.report.chain_picture import chain_svg
from glider.tools.report.charts import Chart, Curve, svg
from glider.tools.report.lines import bands, compared, plan_chart
from glider.tools.report.page import REPORT, render

DRAWN = ("depth", "pitch", "roll", "yaw", "xy")
LEAST_PROBABILITY, MOST_RANKED = 0.005, 8  # of the ranking
LEAST_SHARE, MOST_LINKS = 0.01, 7  # of the links
SHORT_NAMES = {"force and moment": "force"}
MOST_LEFT = 8  # channels in which something is left


def _panel(record: DiagnosisRecord, panel: Panel) -> dict[str, Any]:
    """A list of links with their shares, largest first within what is shown, in the order of the chain."""
    answer, found = record.answer, panel.links
    if panel.label:
        title = f"Of what {panel.label} explains"
    elif answer.verdict == "unknown":
        title = f"Of what is left{f' beyond {words.joined(answer.selected)}' if answer.selected else ''}"
    else:
        title = "Of what the most likely link explains"
    largest = sorted(found, key=lambda link: -link.share)[:MOST_LINKS]
    kept = [link for link in found if link in largest and link.share >= LEAST_SHARE]
    rows = [
        {"stage": SHORT_NAMES.get(link.stage, link.stage), "name": link.name, "percent": 100.0 * link.share}
        for link in kept
    ]
    return {"title": title, "rows": rows}


def _ranking(record: DiagnosisRecord) -> list[dict[str, Any]]:
    effects = catalogue()
    return [
        {
            "label": cause.label,
            "place": words.place(cause.label) if cause.label in effects else "",
            "means": words.means(cause.label, record.answer.gap) or words.PLAIN[cause.label],
            "percent": 100.0 * cause.probability,
            "shown": words.small_percent(cause.probability),
        }
        for n, cause in enumerate(record.answer.causes[:MOST_RANKED])
        if cause.probability >= LEAST_PROBABILITY or n < 3
    ]


def _effects(record: DiagnosisRecord) -> list[dict[str, Any]]:
    """The selected effects: what they mean, and their parameters with 90 % intervals."""
    found = []
    for label in record.answer.selected:
        effect, rows = catalogue()[label], []
        for name, entry in record.answer.cause(label).parameters.items():
            mass = effect.subsystem in ("mass", "actuation")
            values, unit = words.scaled([number(v) for v in (entry.estimate, *entry.ci90)], entry.unit, mass)
            value, low, high = map(words.number, values)
            rows.append({"name": name, "unit": unit, "value": value, "low": low, "high": high})
        found.append({
            "label": label, "place": words.place(label), "plain": words.upper(words.directed(record, label)),
            "summary": effect.summary, "rows": rows, "nat": words.nats(record.details.evidence[label]),
        })  # fmt: skip
    return found


def _noise(record: DiagnosisRecord) -> dict[str, str] | None:
    """Water in disorder: mean NIS without and with it."""
    noise = record.details.noise
    if noise is None or noise.name == CLOCK:
        return None
    before, after = (words.number(number(value)) for value in (noise.nis_before, noise.nis_after))
    return {"name": noise.name, "before": before, "after": after}


def _pictures(record: DiagnosisRecord) -> list[dict[str, Any]]:
    """The drawn runs: measured, nominal and corrected."""
    return [
        {
            "name": with_flight(run.name, record.details.data.flights),
            "before": words.number(number(run.before["total"])),
            "after": words.number(number(run.after["total"])), "charts": _charts(run, curves),
        }
        for run, curves in zip(record.details.pictures, record.curves, strict=True)
    ]  # fmt: skip


def _charts(run: Picture, curves: Curves) -> list[dict[str, Any]]:
    table, t, listed = curves.measured, curves.t, ROUGHIE_MEASURES.windows(curves.t)
    said = {"nominal": curves.nominal, "corrected": curves.corrected}
    drawn = []
    for channel in (c for c in ROUGHIE_MEASURES.channels if c.name in run.channels and c.name in DRAWN):
        if channel.joint:
            chart, least = plan_chart(table, said, channel.columns, listed), 1.0
        else:
            column, scale = channel.columns[0], channel.scale
            columns = {style: Y[:, column] for style, Y in said.items()}
            lines = compared(t, table[:, column], columns, listed, scale, channel.wrapped)
            chart = Chart(f"{channel.name}, {channel.unit}", "s", lines, bands(t, listed), down=channel.name == "depth")
            least = 4.0 * channel.tolerance * scale
        before, after = (words.number(number(gaps.get(channel.name))) for gaps in (run.before, run.after))
        drawn.append({"title": chart.title, "before": before, "after": after, "svg": svg(chart, least)})
    return drawn


def _table(record: DiagnosisRecord) -> list[dict[str, Any]]:
    """Channels, then the total, by the four models."""
    gap = record.answer.gap
    tables = (gap.before, gap.recalibrated, gap.after, gap.floor)
    return [
        {"name": name, "cells": [f"{number(one.get(name)):.2f}".replace("nan", words.DASH) for one in tables]}
        for name in gap.before
    ]


def _groups(record: DiagnosisRecord) -> list[str]:
    """Labels that these data cannot distinguish, of those that matter."""
    answer, said = record.answer, []
    for label in dict.fromkeys([answer.main, *answer.selected]):
        group = words.joined(sorted(answer.cause(label).group))
        if len(answer.cause(label).group) > 1 and group not in said:
            said.append(group)
    return said


def _correction(record: DiagnosisRecord) -> dict[str, str] | None:
    """What a data-driven correction of an unknown gap is like, and does."""
    found = None if record.answer.unknown is None else record.answer.unknown.correction
    if found is None:
        return None
    shapes = [f"{words.feature(name)} ({words.quantity(rms, found.unit)} rms)" for name, rms in found.goes_with.items()]
    share = words.left_of(number(record.answer.gap.before["total"]), number(found.gap["total"]))
    return {
        "link": found.link, "shapes": words.joined(shapes), "file": found.model,
        "far": words.with_interval(words.change(share), found.shrinkage),
        "after": words.number(number(found.gap["total"])),
    }  # fmt: skip


def _waterfall(record: DiagnosisRecord) -> list[dict[str, Any]]:
    """The stages: how far the gap of runs left out is, after what."""
    stages = record.answer.stages
    highest = max((number(one.gap["total"]) for one in stages), default=1.0)
    rows = []
    for one in stages:
        total, (low, high) = number(one.gap["total"]), map(number, one.ci90)
        rows.append({
            "name": one.stage, "added": words.joined(one.added) if one.stage == "readings" else "",
            "total": words.number(total), "interval": words.interval_of(low, high), "percent": 100.0 * total / highest,
        })  # fmt: skip
    return rows


def _readings(record: DiagnosisRecord) -> list[dict[str, Any]]:
    """What is wrong with the readings, a sentence each, with the catalogue's label."""
    return [{"text": one.text, "label": one.label, "mended": one.mended} for one in record.answer.readings]


def _shown(record: DiagnosisRecord) -> list[dict[str, str]]:
    """Pictures of the data behind the readings' findings."""
    drawn = []
    for one in record.shown:
        lines = [Curve(one.x, one.expected, "nominal"), Curve(one.x, one.read, "measured")]
        if np.isfinite(one.mended).any():
            lines.append(Curve(one.x, one.mended, "corrected"))
        drawn.append({"title": one.title, "svg": svg(Chart(one.title, "", lines))})
    return drawn


def _context(record: DiagnosisRecord) -> dict[str, Any]:
    answer, details = record.answer, record.details
    data, gap, effects = details.data, answer.gap, catalogue()
    others = [label for label in answer.selected if label != answer.main and answer.verdict == "cause"]
    left = words.described(record)
    strongest = max((abs(f.sigma) for f in details.findings), default=0.0)
    return {
        "data": data,
        "seconds": f"{data.seconds:.0f}",
        "rate": f"{data.log_rate_hz:g}",
        "verdict": answer.verdict,
        "blind": answer.verdict == "none" and words.blind(gap),
        "sentence": words.sentence(record),
        "chain": chain_svg(
            [] if answer.verdict == "none" else answer.where,
            [effects[label].place for label in others],
            answer.verdict == "unknown",
        ),
        "panels": [_panel(record, panel) for panel in details.panels],
        "ranking": _ranking(record),
        "effects": _effects(record),
        "noise": _noise(record),
        "pictures": _pictures(record),
        "stages": _waterfall(record),
        "readings": _readings(record),
        "shown": _shown(record),
        "corrected": "corrected" if details.corrected else "recalibrated",
        "table": _table(record),
        "which": words.which(record).removesuffix(","),
        "shrinkage": _share(gap.shrinkage),
        "closed": _share(gap.closed),
        "alone": words.alone(gap),
        "predictable": answer.main not in UNPREDICTABLE,
        "tolerances": [
            f"{c.name} {c.tolerance * c.scale:g} {c.unit}" for c in ROUGHIE_MEASURES.channels if c.name in data.channels
        ],
        "groups": _groups(record),
        "cautions": [words.upper(line) for line in answer.cautions],
        "correction": _correction(record),
        "left": left[:MOST_LEFT],
        "left_more": max(0, len(left) - MOST_LEFT),
        "tests": len(details.findings),
        "strongest": words.number(float(strongest)),
        "next_run": answer.next_run,
        "version": details.version,
        "thresholds": details.thresholds,
    }


def _share(share: Interval) -> str:
    """A share with its interval; "" where there is none."""
    return "" if share.value is None else words.with_interval(words.percent(share.value), share)


def report_html(record: DiagnosisRecord) -> str:
    """The page's text; MissingExtra without jinja2."""
    return render("diagnosis.html", _context(record)).replace(" %", "\N{NO-BREAK SPACE}%")


def write_report(folder: Path) -> DiagnosisRecord:
    """Draw the report of a diagnosis from its folder, into it; InputError where the folder holds none."""
    record = read_record(folder)
    write_bytes(folder / REPORT, report_html(record).encode("utf-8"))
    return record
