"""A figure from flights to result: what is flown, what the numbers say in words, the picture."""

from pathlib import Path
from typing import Any

from firmware.model.vehicle import Vehicle
from tools.reproduce import circle, pictures, tracking
from tools.reproduce.design import fly_design

FIGURES = {"fig5": tracking.FIG5, "fig6": tracking.FIG6}
SHOWN_EVERY = 0.2  # s
CONTROLLERS = ("law", "hybrid", "pid", "pid_tuned", "law+")


def _table(rows: list[dict[str, Any]], figure: tracking.Figure) -> list[dict[str, Any]]:
    """Mean tracking error (%) over the targets that count, a line a strength."""
    big = tracking.BIG if figure is tracking.FIG5 else tuple(t for t in figure.targets if t)
    strengths = sorted({row["noise"] for row in rows})
    return [{"noise": s, **{c: tracking.average(rows, c, s, big) for c in CONTROLLERS}} for s in strengths]


def _says(figure: tracking.Figure, table: list[dict], marked: float | None, here: list[dict]) -> str:
    def mean(controller: str, key: str) -> float:
        picked = [row[key] for row in here if row["controller"] == controller and row["state"] == "estimated"]
        return sum(picked) / len(picked)

    where = (
        f"the ruled PID reaches the paper's {tracking.PAPER_PID_ERROR:g} % at a noise of {marked:.3g}"
        if marked is not None
        else f"no noise up to {table[-1]['noise']:g} brings the ruled PID to the paper's {tracking.PAPER_PID_ERROR:g} %"
    )
    there = ", ".join(f"{name} {mean(name, 'tracking_error_pct'):.1f} %" for name in CONTROLLERS)
    said = f"{where}; mean over all targets at the noise of the JSON: {there}"
    if figure is tracking.FIG6:
        said += "; completed: " + ", ".join(f"{name} {100 * mean(name, 'completed'):.0f} %" for name in CONTROLLERS)
    return said


def reproduce_tracking(name: str, vehicle: Vehicle, seeds: int, noise: float | None, out: Path) -> dict[str, Any]:
    """Figure 5 or 6: error against strength for all controllers; cases at one strength, on estimated and true states.

    Without `noise` that strength is where the ruled PID has the paper's 13 %, or the vehicle's own disturbance where it
    never does.
    """
    figure = FIGURES[name]
    swept = tracking.summary(figure, tracking.fly_figure(figure, vehicle, tracking.STRENGTHS, seeds, ("estimated",)))
    big = tracking.BIG if figure is tracking.FIG5 else tuple(t for t in figure.targets if t)
    marked = tracking.strength_at(swept, "pid", big, tracking.PAPER_PID_ERROR)
    chosen = noise if noise is not None else (marked if marked is not None else vehicle.disturbance.linear)
    cases = tracking.summary(figure, tracking.fly_figure(figure, vehicle, (chosen,), seeds, ("estimated", "true")))
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
        "table": table,
        "says": _says(figure, table, marked, cases),
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
