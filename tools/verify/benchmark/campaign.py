"""Many flights at once as `glider campaign` flies them: flights a second with a process a core, and against one."""

import time
from typing import Any

import joblib

from glider.tools.study.campaign.conduct import fly_campaign
from glider.tools.study.campaign.plan import CampaignPlan, build_plan, load_campaign, with_options
from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.timing import alternate, median

OPTIONS = {"missions": ["sawtooth"], "controllers": ["pid", "law"], "seeds": 60}
CHUNK = 10  # flights: many enough chunks that no core is left alone at the end


def fly_all(plan: CampaignPlan, jobs: int) -> float:
    """Fly the whole plan in a number of processes, keeping nothing; flights a second."""
    before = time.perf_counter()
    flown = fly_campaign(plan, jobs=jobs, chunk=CHUNK)
    return len(flown.table) / (time.perf_counter() - before)


def measure(settings: Settings) -> dict[str, Any]:
    """flights_per_s in a process for each core and in one process, the speedup in the same run, cores, flights.

    The processes are there before: a campaign of minutes starts them once.
    """
    plan, cores = build_plan(with_options(load_campaign("robustness")[0], OPTIONS)), joblib.cpu_count()
    fly_all(plan, cores)
    alone, together = alternate(settings.repeats, lambda: fly_all(plan, 1), lambda: fly_all(plan, cores))
    return {
        "flights_per_s": median(together),
        "flights_per_s_one_process": median(alone),
        "speedup": median([many / one for one, many in zip(alone, together, strict=True)]),
        "cores": cores,
        "flights": plan.flights,
    }
