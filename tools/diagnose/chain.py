"""The gap followed through the chain command -> actuator -> force and moment -> motion -> sensor, for the report.

The noise of one link at a time is inflated (tools/diagnose/noise_probes) at the model without an effect, or without
any: what that gains, beside what the effect brings, is the link's share. Noise cannot take the shape of a constant
error or of a delay, so that effects of the catalogue count for their links too, as far as the search followed them.
Shares do not add up: an error of the pump can be taken up by its own speed, and by the draw-wire that measures it.
"""

import numpy as np

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.noise_probes import CLOCK, TURBULENCE, WAVES, NoiseProbe, ProbeResult, probes, run_probes
from glider.tools.diagnose.record import NONE, UNKNOWN, LinkRecord, Noise, Panel
from glider.tools.diagnose.search import Search, without_extra_noise
from glider.tools.diagnose.stages import ACTUATOR, FORCE, MOTION, SENSOR, STAGES, stage_of
from glider.tools.diagnose.verdict import Answer, drop, evidence_of_alternatives
from glider.tools.inference.fit import Hypothesis

SCALES = (3.0, 12.0, 50.0)  # of a probe's unit: coarser than for a verdict
STAGE_OF_PROBE = {"actuator": ACTUATOR, "force": FORCE, "water": MOTION, "sensor": SENSOR}
NAMES = {TURBULENCE: "all forces and moments", WAVES: "water"}
LINK_OF_PLACE = {
    "net": "net mass", "longitudinal": "centre of gravity, lengthwise", "lateral": "centre of gravity, sideways",
    "vertical": "centre of gravity, height", "mocap": "motion capture", "command": "timing of commands",
    **{axis: f"{axis} force" for axis in ("surge", "sway", "heave")},
    **{axis: f"{axis} moment" for axis in ("roll", "pitch", "yaw")},
}  # fmt: skip
RUNS = 1  # that are probed
PANELS = 2  # one for each effect, the first ones
MIN_EVIDENCE_NAT = 10.0  # nat that the best explanation must bring, or there is nothing to share out


def links(search: Search, without: Hypothesis, best: Hypothesis) -> list[LinkRecord]:
    """Every link's share of what `best` brings over `without`, in the order of the chain, by the run that shows most.

    The two may be one: then the shares are of the link that brings most. No links where hardly anything is brought.
    """
    problem, model = search.problem, search.model(without)
    bare, fitted = (problem.filter(*search.model(hypothesis), begin=True).misfit for hypothesis in (without, best))
    shown = np.argsort(-(bare if best is without else bare - fitted))[:RUNS]
    total: dict[NoiseProbe, float] = {}
    for n in shown.tolist():
        for found in run_probes(problem.part(n), *model, probes(problem), SCALES, ()):
            total[found.probe] = total.get(found.probe, 0.0) + found.gain
    probed = [ProbeResult(probe, gain, 1.0) for probe, gain in total.items()]
    return shared_out(probed, 0.5 * float((bare - fitted)[shown].sum()))


def shared_out(probed: list[ProbeResult], brought: float) -> list[LinkRecord]:
    """Shares of probes of the best explanation's nat: the effects' or, where that is more, a probe's own."""
    brought = max([brought, *(found.gain for found in probed)])
    if brought < MIN_EVIDENCE_NAT:
        return []
    shared = []
    for found in probed:
        name = NAMES.get(found.probe.name, found.probe.name)
        shared.append(
            LinkRecord(STAGE_OF_PROBE[found.probe.stage], name, float(np.clip(found.gain / brought, 0.0, 1.0)))
        )
    return ordered(shared)


def by_effects(search: Search, without: Hypothesis, best: Hypothesis, label: str) -> list[LinkRecord]:
    """The same by effects of the catalogue that the search has tried in the place of `label`: a link's best counts."""
    bare, effects = without.log_evidence(search.fitter), catalogue()
    brought = best.log_evidence(search.fitter) - bare
    if brought < MIN_EVIDENCE_NAT:
        return []
    shared = []
    for other, value in evidence_of_alternatives(search, best, label).items():
        place = effects[other].subsystem, effects[other].element
        share = float(np.clip((value - bare) / brought, 0.0, 1.0))
        shared.append(LinkRecord(stage_of(*place), LINK_OF_PLACE.get(place[1], place[1]), share))
    return ordered(shared)


def ordered(shared: list[LinkRecord]) -> list[LinkRecord]:
    """Each link once, with its largest share, in the order of the chain."""
    most: dict[tuple[str, str], LinkRecord] = {}
    for link in shared:
        known = most.get((link.stage, link.name))
        most[link.stage, link.name] = link if known is None or known.share < link.share else known
    return sorted(most.values(), key=lambda link: (STAGES.index(link.stage), -link.share))


def panels(verdict: str, answer: Answer) -> list[Panel]:
    """The shares of links in what each effect brings; for an unknown gap in what is left, for none nothing."""
    search = answer.search
    if verdict == NONE:
        return []
    if verdict == UNKNOWN and answer.probed:
        return [Panel("", shared_out(answer.probed, 0.0))]
    fitted = [label for label in answer.selected if label in answer.hypothesis.labels][:PANELS]
    water = answer.noise is not None and answer.noise.probe.name != CLOCK
    if water or not fitted:
        seen = without_extra_noise(search) if water else search
        return [Panel("", links(seen, search.null, search.null))]
    found = []
    for label in fitted:
        without = drop(search, answer.hypothesis, label)
        shares = links(search, without, answer.hypothesis) + by_effects(search, without, answer.hypothesis, label)
        found.append(Panel(label, ordered(shares)))
    return found


def noise_of(answer: Answer) -> Noise | None:
    """The disorder that the search knows of; for water in disorder also the mean NIS with and without."""
    noise, search = answer.noise, answer.search
    if noise is None:
        return None
    if noise.probe.name == CLOCK:
        return Noise(noise.probe.name, float(noise.scale))
    model = search.model(search.null)
    filtered = (one.problem.filter(*model, begin=True) for one in (without_extra_noise(search), search))
    return Noise(noise.probe.name, float(noise.scale), *(float(np.nanmean(own.E**2)) for own in filtered))
