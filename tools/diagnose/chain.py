"""The gap followed through the chain command -> actuator -> force and moment -> motion -> sensor, for the report.

Links are freed one at a time (tools/diagnose/probes) at the model without an effect, or without any: what a link brings
when it may err as it likes, beside what that effect brings, is its share. Noise cannot take the shape of a constant
error or of a delay, so that effects of the catalogue count for their links too, as far as the search followed them.
Shares do not add up: an error of the pump can be taken up by its own speed, and by the draw-wire that measures it.
"""

from dataclasses import dataclass, replace

import numpy as np

from sim_backend.effects.catalogue import catalogue
from tools.diagnose.probes import TURBULENCE, WAVES, Probe, Probed, probe_model, probes
from tools.diagnose.search import Search
from tools.diagnose.verdict import instead
from tools.inference.fit import Course

COMMAND, ACTUATOR, FORCE, MOTION, SENSOR = STAGES = ("command", "actuator", "force and moment", "motion", "sensor")
SCALES = (3.0, 12.0, 50.0)  # of a probe's unit: coarser than for a verdict
STAGE_OF_PROBE = {"actuator": ACTUATOR, "force": FORCE, "water": MOTION, "sensor": SENSOR}
STAGE_OF_PLACE = {
    "actuation": ACTUATOR, "hydrodynamics": FORCE, "mass": FORCE, "environment": MOTION, "sensing": SENSOR
}  # fmt: skip
NAMES = {TURBULENCE: "all forces and moments", WAVES: "water"}
LINK_OF_PLACE = {
    "net": "net mass", "longitudinal": "centre of gravity, lengthwise", "lateral": "centre of gravity, sideways",
    "vertical": "centre of gravity, height", "mocap": "motion capture", "command": "timing of commands",
    **{axis: f"{axis} force" for axis in ("surge", "sway", "heave")},
    **{axis: f"{axis} moment" for axis in ("roll", "pitch", "yaw")},
}  # fmt: skip
RUNS = 1  # that are probed
LEAST = 10.0  # nat that the best explanation must bring, or there is nothing to share out


@dataclass(frozen=True)
class Link:
    """A link that was freed: of what the best explanation brings, the share it brings, 0 to 1."""

    stage: str
    name: str
    share: float


@dataclass(frozen=True)
class Scatter:
    """Mean square of what each sample brings anew at the recalibrated model, by what the model expects of it."""

    calm: float  # with the case's disturbance
    rough: float  # with the disturbance or the waves that were found


def stage_of(subsystem: str, element: str) -> str:
    """The stage of the chain that a place belongs to."""
    if subsystem == "timing":
        return COMMAND if element == "command" else SENSOR
    if (subsystem, element) == ("mass", "inertia"):
        return MOTION
    return STAGE_OF_PLACE[subsystem]


def links(search: Search, without: Course, best: Course) -> list[Link]:
    """Every link's share of what `best` brings over `without`, in the order of the chain, by the run that shows most.

    The two may be one: then the shares are of the link that brings most. No links where hardly anything is brought.
    """
    problem, model = search.problem, search.model(without)
    bare, fitted = (problem.filter(*search.model(course)).misfit for course in (without, best))
    told = np.argsort(-(bare if best is without else bare - fitted))[:RUNS]
    total: dict[Probe, float] = {}
    for n in told.tolist():
        for found in probe_model(problem.part(n), *model, probes(problem), SCALES, ()):
            total[found.probe] = total.get(found.probe, 0.0) + found.gain
    freed = [Probed(probe, gain, 1.0) for probe, gain in total.items()]
    return shared_out(freed, 0.5 * float((bare - fitted)[told].sum()))


def shared_out(freed: list[Probed], brought: float) -> list[Link]:
    """Shares of probes of the best explanation's nat: the effects' or, where that is more, a probe's own."""
    brought = max([brought, *(found.gain for found in freed)])
    if brought < LEAST:
        return []
    shared = []
    for found in freed:
        name = NAMES.get(found.probe.name, found.probe.name)
        shared.append(Link(STAGE_OF_PROBE[found.probe.stage], name, float(np.clip(found.gain / brought, 0.0, 1.0))))
    return ordered(shared)


def by_effects(search: Search, without: Course, best: Course, label: str) -> list[Link]:
    """The same by effects of the catalogue that the search has tried in the place of `label`: a link's best counts."""
    bare, effects = without.log_evidence(search.fitter), catalogue()
    brought = best.log_evidence(search.fitter) - bare
    if brought < LEAST:
        return []
    shared = []
    for other, value in instead(search, best, label).items():
        place = effects[other].subsystem, effects[other].element
        share = float(np.clip((value - bare) / brought, 0.0, 1.0))
        shared.append(Link(stage_of(*place), LINK_OF_PLACE.get(place[1], place[1]), share))
    return ordered(shared)


def ordered(shared: list[Link]) -> list[Link]:
    """Each link once, with its largest share, in the order of the chain."""
    most: dict[tuple[str, str], Link] = {}
    for link in shared:
        known = most.get((link.stage, link.name))
        most[link.stage, link.name] = link if known is None or known.share < link.share else known
    return sorted(most.values(), key=lambda link: (STAGES.index(link.stage), -link.share))


def calm(search: Search) -> Search:
    """A search that was told of turbulence or waves, with the case's own disturbance again."""
    return replace(search, problem=replace(search.problem, told=None))


def scatter(search: Search, null: Course) -> Scatter:
    """How much of the scatter the turbulence or the waves that a search was told of explain, at a model."""
    model = search.model(null)
    both = (calm(search).problem, search.problem)
    return Scatter(*(float(np.nanmean(problem.filter(*model).E ** 2)) for problem in both))
