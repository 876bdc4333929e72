"""What identification found as files: identified.toml (the vehicle file, with its new numbers) and identified.json."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.plain import as_plain
from glider.tools.data.version import software
from glider.tools.own.decision import from_one_session
from glider.tools.own.effects import FORM, PUSH
from glider.tools.own.evidence import interval
from glider.tools.own.identify import Identified
from glider.tools.own.measure import gap_row
from glider.tools.own.model_files import moved_to, write_with_folders
from glider.tools.own.runs_fit import MIN_SCATTER_RUNS

VEHICLE, ANSWER = "identified.toml", "identified.json"
FAR = 3.0  # sigma of the file: a number that is said to be farther from it


def _text(value: Any) -> str:
    """A TOML value."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_text(one) for one in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_text(one)}" for key, one in value.items()) + " }"
    return repr(float(f"{value:.10g}")) if isinstance(value, float) else str(value)


def toml_text(tables: dict[str, Any]) -> str:
    """Tables two levels deep as TOML: what stands loose first, then [table] and [table.name]."""
    lines = [f"{key} = {_text(value)}" for key, value in tables.items() if not isinstance(value, dict)]
    for name, table in tables.items():
        if not isinstance(table, dict) or not table:
            continue
        loose = {
            key: value for key, value in table.items() if not isinstance(value, dict) or name in ("start", "identified")
        }
        if loose:
            lines += ["", f"[{name}]", *(f"{key} = {_text(value)}" for key, value in loose.items())]
        for key, value in table.items():
            if key not in loose:
                lines += ["", f"[{name}.{key}]", *(f"{inner} = {_text(one)}" for inner, one in value.items())]
    return "\n".join(lines) + "\n"


def tables(found: Identified) -> dict[str, Any]:
    """The vehicle file's tables with the numbers that are handed out in them, and what runs leave."""
    vehicle, observer = found.vehicle, found.observer
    declared = vehicle.declared
    given = tomllib.loads(vehicle.text)
    values, errors = found.handed_out
    sd = np.sqrt(np.diag(errors))
    scatter, session = ({one.label: float(s * one.spread) for one, s in zip(found.nuisance, by.sizes, strict=True)}
                        for by in (found.scatter, found.session_scatter))  # fmt: skip
    usual = {name: {one.label: float(s * one.spread) for one, s in zip(found.labels, row, strict=True)}
             for name, row in (("label_mean", found.usual.mean), ("label_mean_error", found.usual.error),
                               ("label_scatter", found.usual.scatter),
                               ("label_session_scatter", found.usual.session))}  # fmt: skip
    parameters = given.setdefault("parameters", {})
    sensors = given.setdefault("sensors", {})
    names, places, form, effects = [], [], {}, dict(declared.effects)
    for k, one in enumerate(found.nuisance):
        move, error = float(values[k] * one.spread), float(sd[k] * one.spread)
        if one.family == "parameter":
            before = declared.parameters[declared.index("parameters", one.name)]
            table = parameters.setdefault(one.name, {})
            value = min(max(before.value + move, before.low), before.high)
            spread = scatter[one.label]
            own = max(error, float(np.hypot(spread, session[one.label]))) if before.scope == "run" else error
            table |= {"value": value, "uncertainty": own, "scatter": spread}
            table.pop("assumed", None)
            names.append(one.name)
            places.append(k)
        elif one.family == FORM:
            form[one.label] = declared.form.get((one.name, one.kind), 0.0) + move
            names.append(one.label)
            places.append(k)
        elif one.label in found.effects:
            effects[one.label] = effects.get(one.label, 0.0) + move
            names.append(one.label)
            places.append(k)
        elif one.family != PUSH:
            output = declared.outputs[declared.index("outputs", one.name)]
            sensors.setdefault(one.name, {})["offset"] = output.offset + move
    for n, output in enumerate(declared.outputs):
        table = sensors.setdefault(output.name, {})
        table["noise"] = float(np.sqrt(observer.point.variance[n]))
        table["tolerance"] = float(observer.tolerances[n])
    given["noise"] = {one.name: {"density": float(observer.point.density[n])} for n, one in enumerate(declared.noises)}
    given["windows"] = {"seconds": observer.horizon}
    given["effects"] = effects
    units = np.array([found.nuisance[k].spread for k in places])
    covariance = errors[np.ix_(places, places)] * np.outer(units, units)
    given["identified"] = {
        "runs": len(observer.runs), "sessions": len(found.counts), "parameters": names,
        "covariance": [[float(value) for value in row] for row in covariance], "inflation": found.eta,
        "run_inflation": found.run_inflation,
        "level_scatter": found.level_scatter,
        "scatter": {name: value for name, value in scatter.items() if value > 0.0},
        "session_scatter": {name: value for name, value in session.items() if value > 0.0}, **_together(found), **usual,
        "noise_gain": found.noise_gain, "form": form,
        "input_shares": dict(declared.input_shares),
        "operating_points": [list(one) for one in declared.operating_points],
        "operating_scatter": _operating(found),
        "usual_inputs": {name: list(pair) for name, pair in declared.usual_inputs.items()},
        "gap": {one.name: float(value) for one, value in zip(declared.outputs, found.errors.scales, strict=True)},
        "channel_inflation": {
            one.name: float(value) for one, value in zip(declared.outputs, found.errors.inflation, strict=True)
        },
        **_components(found),
        "software": software(),
    }  # fmt: skip
    return given


def _doubtful(found: Identified, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Parameters whose sign is not the file's, and too few runs to learn how they differ."""
    known, count = {one.name for one in found.vehicle.declared.parameters}, len(found.observer.runs)
    turned = [row for row in rows if row["name"] in known and max(row["file"] * end for end in row["ci90"]) < 0.0]
    said = [f"{row['name']} changes its sign, {row['file']:.4g} to {row['mean']:.4g}: `low` or `high` in the vehicle "
            "file rules that out" for row in turned]  # fmt: skip
    file = {one.name: one for one in found.vehicle.declared.parameters}
    far = [row for row in rows if row["name"] in known and file[row["name"]].uncertainty > 0.0
           and abs(row["mean"] - row["file"]) > FAR * file[row["name"]].uncertainty]  # fmt: skip
    said += [f"{row['name']} is {abs(row['mean'] - row['file']) / file[row['name']].uncertainty:.1f} sigma from the "
             f"file's {row['file']:.4g}: {row['mean']:.4g} +- {row['sd']:.2g}" for row in far]  # fmt: skip
    if count < MIN_SCATTER_RUNS:
        said.append(f"how runs differ is assumed, not learned: {MIN_SCATTER_RUNS} runs are needed, got {count}")
    return said


def plain(found: Identified) -> dict[str, Any]:
    """identified.json: numbers with intervals, gaps of runs left out before and after, groups that data do not part."""
    sd = np.sqrt(np.diag(found.covariance))
    rows = []
    for k, one in enumerate(found.nuisance):
        if one.at_point is not None:  # none of these means anything alone
            continue
        start = found.vehicle.declared.effects.get(one.label, 0.0)
        if one.family == "parameter":
            start = found.vehicle.declared.parameters[found.vehicle.declared.index("parameters", one.name)].value
        mean, error = start + float(found.values[k] * one.spread), float(sd[k] * one.spread)
        ends = [start + end for end in interval(one, found.values[k], sd[k])]
        runs = [start + float(row[k] * one.spread) for row in found.run_values]
        rows.append({"name": one.label, "mean": mean, "sd": error, "ci90": ends, "unit": one.unit, "file": start,
                     "runs": runs})  # fmt: skip
    names = [one.name for one in found.vehicle.declared.outputs]
    shown = [f"all runs show {label}, which the model does not have: [effects] of the vehicle has it"
             for label in found.effects if found.better]  # fmt: skip
    return {
        "format": 1, "vehicle": found.vehicle.name, "parameters": rows, "groups": groups(found),
        "operating_points": {"count": len(found.vehicle.declared.operating_points), "scatter": _operating(found)},
        "gap": {"before": gap_row(names, found.before), "after": gap_row(names, found.after)},
        "sessions": [{"first": runs[0], "runs": len(runs), **{name: gap_row(names, gaps[at]) for name, gaps in
                      (("before", found.before), ("after", found.after))}} for runs, at in _sessions(found)],
        "horizon_s": found.observer.horizon,
        "channel_ratio": found.channel_ratio, "handed_out": "identified" if found.better else "file",
        "runs": [run.name for run in found.observer.runs],
        "notes": [
            *found.observer.notes, *found.notes, *shown, *_doubtful(found, rows), *from_one_session(len(found.counts)),
        ],
    }  # fmt: skip


def _sessions(found: Identified) -> list[tuple[list[str], slice]]:
    """Runs of every session by name, and where they stand among all."""
    ends = np.cumsum(found.counts).tolist()
    every = [slice(end - count, end) for end, count in zip(ends, found.counts, strict=True)]
    return [([run.name for run in found.observer.runs[at]], at) for at in every]


def _together(found: Identified) -> dict[str, Any]:
    """Correlations of what runs and sessions differ by, where there are any."""
    free, every = found.scatter.free, (("scatter", found.scatter), ("session", found.session_scatter))
    return {f"{name}_correlation": one.correlation[np.ix_(free, free)].tolist()
            for name, one in every if one.correlation is not None}  # fmt: skip


def _components(found: Identified) -> dict[str, Any]:
    """What errors of windows are made of, where that is known."""
    declared, by = found.vehicle.declared, found.components
    if by is None:
        return {}
    return {
        "row_noise": {one.name: float(value) for one, value in zip(declared.outputs, by.white, strict=True)},
        "force_variance": {one.name: float(value) for one, value in zip(declared.noises, by.forces, strict=True)},
        "held_force_variance": {one.name: float(value) for one, value in zip(declared.noises, by.held, strict=True)},
        "start_variance": by.start,
    }


def _operating(found: Identified) -> dict[str, float]:
    """1 sigma, by noise, of the force that goes with the operating point."""
    return {one.name: found.operating_scatter[one.name] * one.spread for one in found.nuisance if one.at_point == 0}


def groups(found: Identified, correlation: float = 0.98) -> list[list[str]]:
    """Parameters that the data do not part: posterior correlations beyond 0.98."""
    sd = np.sqrt(np.diag(found.covariance))
    R = found.covariance / np.maximum(np.outer(sd, sd), 1e-300)
    left, listed = [k for k in np.flatnonzero(sd > 0.0) if found.nuisance[k].at_point is None], []
    while left:
        k = left.pop(0)
        own = [j for j in left if abs(R[k, j]) > correlation]
        if own:
            listed.append([found.nuisance[j].label for j in (k, *own)])
            left = [j for j in left if j not in own]
    return listed


def write(found: Identified, out: Path) -> None:
    """identified.toml and identified.json into a folder; the model's own files beside them."""
    files, vehicle = moved_to(out, found.vehicle, tables(found))
    files |= {
        out / VEHICLE: toml_text(vehicle).encode("utf-8"),
        out / ANSWER: (json.dumps(as_plain(plain(found)), indent=1) + "\n").encode("utf-8"),
    }
    write_with_folders(files)
