"""The report of a diagnosis, drawn from its folder: one HTML file that opens offline, on a phone too."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.files import write_bytes
from glider.tools.diagnose.noise_probes import CLOCK, UNPREDICTABLE
from glider.tools.diagnose.record import (
    DiagnosisRecord,
    EstimateRecord,
    Interval,
    Panel,
    Regressor,
    number,
    read_record,
)
from glider.tools.diagnose.residuals import FEATURE_UNITS
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.report import words
from glider.tools.report.chain_picture import chain_svg
from glider.tools.report.charts import Chart, Curve, svg
from glider.tools.report.now import download, steps
from glider.tools.report.page import REPORT, plotting, render
from glider.tools.report.traces import Claim, Traces

NOMINAL, CORRECTED = "nominal", "corrected"
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


def _effects(record: DiagnosisRecord, traces: Traces) -> list[dict[str, Any]]:
    """The selected effects: what they mean, their parameters, and what they explain against which feature."""
    found = []
    for label in record.answer.selected:
        effect, rows = catalogue()[label], []
        shown = next((one for one in record.details.regressors if one.label == label), None)
        estimates = {} if shown is None else shown.estimates
        mass = effect.subsystem in ("mass", "actuation")
        for name, entry in record.answer.cause(label).parameters.items():
            alone = [number(one.estimate) for one in estimates.get(name, [])]
            ends = [min(alone), max(alone)] if len(alone) > 1 else []
            values, unit = words.scaled([number(v) for v in (entry.estimate, *entry.ci90, *ends)], entry.unit, mass)
            value, low, high, *spread = map(words.number, values)
            rows.append({"name": name, "unit": unit, "value": value, "low": low, "high": high,
                         "runs": " to ".join(spread) or words.DASH})  # fmt: skip
        found.append({
            "label": label, "place": words.place(label), "plain": words.upper(words.directed(record, label)),
            "summary": effect.summary, "rows": rows, "nat": words.nats(record.details.evidence[label]),
            "chart": None if shown is None else _against_feature(shown, traces),
            "by_run": [
                f"{one.run}, {name}: {words.sized(EstimateRecord(one.estimate, one.ci90, entry.unit), mass)}"
                for name, entry in record.answer.cause(label).parameters.items() for one in estimates.get(name, [])
            ],
        })  # fmt: skip
    return found


def _against_feature(shown: Regressor, traces: Traces) -> dict[str, Any]:
    """Mean innovations without an effect against a feature of flight, and what the effect predicts of them."""
    x, mean, error, fit, _ = np.array(shown.bins).T
    scaled, unit = words.scaled(x.tolist(), shown.unit or "1")
    x = np.array(scaled)
    none = np.full(len(x), np.nan)
    lines = [
        Curve(np.repeat(x, 3), np.stack([mean - 2.0 * error, mean + 2.0 * error, none], 1).ravel(), "spread"),
        Curve(np.repeat(x, 3), np.stack([mean, mean, none], 1).ravel(), "dots"),
        Curve(x, fit, "corrected"),
    ]
    feature, channel = words.feature(shown.feature), words.channel(shown.channel)
    title = f"innovation of {channel}, sd, against {feature}{f', {unit}' if unit else ''}"
    return {
        "title": title, "svg": svg(Chart(title, unit, lines), 1.0), "feature": feature, "channel": channel,
        "features": len(FEATURE_UNITS), "claim": traces.claim(shown.run, shown.second, shown.channel),
    }  # fmt: skip


def _noise(record: DiagnosisRecord) -> dict[str, str] | None:
    """Water in disorder: mean NIS without and with it."""
    noise = record.details.noise
    if noise is None or noise.name == CLOCK:
        return None
    before, after = (words.number(number(value)) for value in (noise.nis_before, noise.nis_after))
    return {"name": noise.name, "before": before, "after": after}


def _table(record: DiagnosisRecord, traces: Traces) -> list[dict[str, Any]]:
    """Channels, then the total, by the four models, each with the least and the largest of the drawn runs."""
    gap, rows = record.answer.gap, list[dict[str, Any]]()
    for name in gap.before:
        cells = []
        for which in ("before", "recalibrated", "after", "floor"):
            runs = [number(getattr(one, which).get(name)) for one in record.details.pictures]
            runs = [value for value in runs if np.isfinite(value)]
            value = f"{number(getattr(gap, which).get(name)):.2f}".replace("nan", words.DASH)
            spread = f"{min(runs):.2f} to {max(runs):.2f}" if len(runs) > 1 else ""
            cells.append({"value": value, "runs": spread})
        rows.append({"name": name, "cells": cells, "claim": None if name == "total" else traces.largest(name, NOMINAL)})
    return rows


def _linked(record: DiagnosisRecord, traces: Traces) -> list[dict[str, Any]]:
    """The verdict's sentence in parts: the names of effects lead to where they are largest in the runs."""
    said, answer = words.sentence(record), record.answer
    claims = {label: effect_claim(record, traces, label) for label in answer.selected}
    if not answer.selected and said.startswith("A gap that"):
        return [{"text": "A gap", "claim": traces.largest(None, CORRECTED)},
                {"text": said.removeprefix("A gap"), "claim": None}]  # fmt: skip
    # a label stands in brackets or in a list; elsewhere `lift` and `current` are words
    labels = "|".join(map(re.escape, claims))
    parts = re.split(rf"(?<=[( ])({labels})(?=[,;)]| and )", said) if labels else [said]
    return [{"text": part, "claim": claims.pop(part, None)} for part in parts]


def effect_claim(record: DiagnosisRecord, traces: Traces, label: str) -> Claim | None:
    """Where an effect is largest in the drawn runs.

    Of one that was not fitted there: where the nominal model is off most in the reading that shows it, or in any.
    """
    shown = next((one for one in record.details.regressors if one.label == label), None)
    own = None if shown is None else traces.claim(shown.run, shown.second, shown.channel)
    readings = [one.channel for one in record.answer.readings if one.label == label]
    found = (own, *(traces.largest(reading, NOMINAL) for reading in (*readings, catalogue()[label].element, None)))
    return next((claim for claim in found if claim is not None), None)


def _drawn(record: DiagnosisRecord) -> str:
    """Why these runs are drawn."""
    shown, runs = len(record.details.pictures), record.details.data.runs
    return "All runs." if shown == runs else f"{shown} of {runs} runs: those with the largest gaps before."


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


def _readings(record: DiagnosisRecord, traces: Traces) -> list[dict[str, Any]]:
    """What is wrong with the readings, a sentence each, with the catalogue's label."""
    return [
        {"text": one.text, "label": one.label, "claim": traces.largest(one.channel, NOMINAL)}
        for one in record.answer.readings
    ]


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
    traces = Traces(record)
    left = [row | {"claim": traces.largest(row["reading"], CORRECTED)} for row in words.described(record)]
    now = steps(record)
    for step in now["checks"]:
        step["claim"] = effect_claim(record, traces, step["label"]) if step["label"] in answer.selected else None
    flown = traces.plain()
    strongest = max((abs(f.sigma) for f in details.findings), default=0.0)
    return {
        "data": data,
        "seconds": f"{data.seconds:.0f}",
        "rate": f"{data.log_rate_hz:g}",
        "verdict": answer.verdict,
        "blind": answer.verdict == "none" and words.blind(gap),
        "sentence": _linked(record, traces),
        "now": now,
        "download": download(record.mission),
        "chain": chain_svg(
            [] if answer.verdict == "none" else answer.where,
            [effects[label].place for label in others],
            answer.verdict == "unknown",
        ),
        "panels": [_panel(record, panel) for panel in details.panels],
        "ranking": _ranking(record),
        "effects": _effects(record, traces),
        "noise": _noise(record),
        "traces": flown,
        "flown": json.dumps(flown, separators=(",", ":")).replace("<", "\\u003c"),
        "drawn": _drawn(record),
        "stages": _waterfall(record),
        "readings": _readings(record, traces),
        "shown": _shown(record),
        "corrected": "corrected" if details.corrected else "recalibrated",
        "table": _table(record, traces),
        "spread": len(record.details.pictures) > 1,
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
    context = _context(record) | plotting("traces.js")
    return render("diagnosis.html", context).replace(" %", "\N{NO-BREAK SPACE}%")


def write_report(folder: Path) -> DiagnosisRecord:
    """Draw the report of a diagnosis from its folder, into it; InputError where the folder holds none."""
    record = read_record(folder)
    write_bytes(folder / REPORT, report_html(record).encode("utf-8"))
    return record
