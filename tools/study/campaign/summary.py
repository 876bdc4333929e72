"""What a campaign says: share of flights completed with its interval, errors, actuator travel, why the rest ended."""

import math
from typing import Any

import numpy as np

from glider.tools.data.intervals import wilson
from glider.tools.study.campaign.conduct import FlownChunk
from glider.tools.study.campaign.flights import ENDINGS

ALL = "all"
# name in the result, column of the table, factor from SI
MEASURES = (
    ("depth_error_m", "depth_error_m", 1.0), ("pitch_error_deg", "pitch_error_rad", 180.0 / math.pi),
    ("roll_error_deg", "roll_error_rad", 180.0 / math.pi), ("seconds", "seconds", 1.0),
    ("servo_travel_rad", "servo_travel_rad", 1.0), ("slider_travel_m", "slider_travel_m", 1.0),
    ("ballast_travel_kg", "ballast_travel_kg", 1.0),
)  # fmt: skip


def _spread(values: np.ndarray) -> dict[str, float | None]:
    """Mean, median and 90th percentile of what is not NaN."""
    values = values[np.isfinite(values)]
    if not values.size:
        return {"mean": None, "median": None, "p90": None}
    return {"mean": float(values.mean()), "median": float(np.median(values)), "p90": float(np.percentile(values, 90.0))}


def completed_by_all(flown: FlownChunk) -> np.ndarray:
    """True for each flight whose world every controller completed: errors are compared there, shape (flights,)."""
    controllers = len(flown.plan.campaign.controllers)
    worlds = flown.column("within_limits").reshape(-1, controllers)  # the table's order has controllers innermost
    return np.repeat(worlds.all(axis=1), controllers)


def _entry(flown: FlownChunk, which: np.ndarray, common: np.ndarray) -> dict[str, Any]:
    """One controller's result over the flights chosen by `which`, errors and ways over those also in `common`."""
    within = flown.column("within_limits")[which] == 1.0
    codes, counts = np.unique(flown.column("ended")[which][~within], return_counts=True)
    order = np.argsort(-counts, kind="stable")
    entry: dict[str, Any] = {
        "flights": int(which.sum()),
        "completed": float(within.mean()),
        "completed_ci90": wilson(int(within.sum()), len(within)),
        "reasons": {ENDINGS[float(codes[i])]: int(counts[i]) for i in order},
        "compared": int((which & common).sum()),
    }
    for name, column, factor in MEASURES:
        entry[name] = _spread(flown.column(column)[which & common] * factor)
    return entry


def summarise(flown: FlownChunk) -> dict[str, Any]:
    """The campaign's result: an entry for each controller over all missions, and for each mission (`by_mission`)."""
    campaign = flown.plan.campaign
    common, mission = completed_by_all(flown), flown.column("mission")
    controllers, by_mission = [], []
    for number, name in enumerate(campaign.controllers):
        own = flown.column("controller") == number
        controllers.append({"controller": name, "mission": ALL, **_entry(flown, own, common)})
        for m, the_mission in enumerate(flown.plan.missions):
            entry = _entry(flown, own & (mission == m), common)
            by_mission.append({"controller": name, "mission": the_mission.name, **entry})
    return {
        "name": campaign.name,
        "vehicle": flown.plan.vehicle.name,
        "flights": len(flown.table),
        "worlds": len(flown.table) // len(campaign.controllers),
        "flown_now": flown.fresh,
        "seconds": flown.seconds,
        "flights_per_s": flown.fresh / flown.seconds if flown.fresh else None,
        "controllers": controllers,
        "by_mission": by_mission,
    }
