"""A figure from flights to result: what is flown, what the numbers say in words, the picture."""

from pathlib import Path
from typing import Any

from glider.firmware.model.vehicle import Vehicle
from glider.tools.study.reproduce import circle, pictures, tracking
from glider.tools.study.reproduce.design import fly_design

FIGURES = {"fig5": tracking.FIG5, "fig6": tracking.FIG6}
SHOWN_EVERY = 0.2  # s
CONTROLLERS = ("law", "hybrid", "pid", "pid_tuned", "law+")


def counted(figure: tracking.TrackingFigure) -> tuple[float, ...]:
    """The targets that the means are over: the paper's larger pitch angles, every depth but the one held."""
    return tracking.BIG if figure is tracking.FIG5 else tuple(target for target in figure.targets if target)


def groups(figure: tracking.TrackingFigure) -> dict[str, tuple[float, ...]]:
    """Targets that are compared together, by name."""
    if figure is tracking.FIG5:
        return {"45 deg": (45.0, -45.0), "30 and 45 deg": tracking.BIG}
    changes = counted(figure)
    return {"changes": changes, "ascents": tuple(change for change in changes if change < 0.0)}


def _table(rows: list[dict[str, Any]], figure: tracking.TrackingFigure) -> list[dict[str, Any]]:
    """A line a strength: mean tracking error (%) over the targets that count and, for depths, the share completed."""
    table = []
    for strength in sorted({row["noise"] for row in rows}):
        line = {"noise": strength}
        for name in CONTROLLERS:
            line[name] = tracking.average(rows, name, strength, counted(figure))
        if figure is tracking.FIG6:
            for name in CONTROLLERS:
                line[f"completed_{name}"] = tracking.average(rows, name, strength, counted(figure), "completed")
        table.append(line)
    return table


def _says(figure: tracking.TrackingFigure, rows: list[dict], marked: float | None, table: list[dict]) -> str:
    """What the sweep says of the paper's claim, in a sentence."""
    if marked is None:
        strongest = table[-1]["noise"]
        return f"no noise up to {strongest:g} brings the ruled PID to the paper's {tracking.PAPER_PID_ERROR:g} %"
    there = ", ".join(f"{name} {tracking.error_at(rows, name, counted(figure), marked):.1f} %" for name in CONTROLLERS)
    return f"where the ruled PID has the paper's {tracking.PAPER_PID_ERROR:g} %, at a noise of {marked:.3g}: {there}"


def reproduce_tracking(name: str, vehicle: Vehicle, seeds: int, noise: float | None, out: Path) -> dict[str, Any]:
    """Figure 5 or 6: error against strength for all controllers; cases at one strength, on estimated and true states.

    Without `noise` that strength is PAPER_DISTURBANCE_SCALE times the vehicle file's disturbance.
    """
    figure = FIGURES[name]
    sweep = tracking.fly_figure(figure, vehicle, tracking.STRENGTHS, seeds, ("estimated",))
    swept = tracking.summary(figure, sweep)
    marked = tracking.strength_at(swept, "pid", counted(figure), tracking.PAPER_PID_ERROR)
    chosen = noise if noise is not None else tracking.PAPER_DISTURBANCE_SCALE * vehicle.disturbance.linear
    both = tracking.fly_figure(figure, vehicle, (chosen,), seeds, ("estimated", "true"))
    cases = tracking.summary(figure, both)
    legs = {target: figure.leg(target) for target in figure.targets}
    shown = fly_design(vehicle, legs, tracking.variants(vehicle), [chosen], range(1), trace_every=SHOWN_EVERY)
    picture = out / f"{name}.png"
    pictures.tracking_picture(figure, swept, shown, chosen, marked, picture)
    table = _table(swept, figure)
    return {
        "figure": name,
        "cases": cases,
        "noise": chosen,
        "noise_where_pid_has_13_pct": marked,
        "sweep": swept,
        "compared": {
            name: tracking.compare(figure, sweep, targets) + tracking.compare(figure, both, targets)
            for name, targets in groups(figure).items()
        },
        "table": table,
        "says": _says(figure, swept, marked, table),
        "picture": str(picture),
    }


def reproduce_circle(vehicle: Vehicle, seeds: int, out: Path) -> dict[str, Any]:
    """Figure 7: the manoeuvre by the hybrid from estimated states, in calm water and under noise."""
    flown = circle.fly_circles(vehicle, "hybrid", circle.STRENGTHS, seeds)
    cases = circle.summary(flown, "hybrid")
    picture = out / "fig7.png"
    pictures.circle_picture(flown, picture)
    calm = cases[0]
    return {
        "figure": "fig7",
        "cases": cases,
        "noise": [row["noise"] for row in cases],
        "table": [
            {key: row[key] for key in ("noise", "completed", "closure_m", "closure_p90_m", "one_way")} for row in cases
        ],
        "says": (
            f"in calm water the circle closes within {calm['closure_m']:.2f} m (median; hull {circle.HULL} m), "
            f"{100 * calm['within_hull_length']:.0f} % of the flights within one hull length"
        ),
        "picture": str(picture),
    }
