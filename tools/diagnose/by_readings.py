"""What readings are certain of by themselves, in the answer's terms: labels with their sizes and evidence.

Whatever the model of the vehicle comes to, readings that contradict each other are wrong by as much
(docs/reference/gap.md).
"""

from dataclasses import dataclass
from typing import Any

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.gap.corrected import one_scale
from glider.tools.inference.parameters import NINETY
from glider.tools.readings.findings import Finding


@dataclass(frozen=True)
class Size:
    """A parameter with its 90 % interval, in its unit."""

    estimate: float
    ci90: tuple[float, float]
    unit: str

    def plain(self) -> dict[str, Any]:
        """The entry in diagnosis.json."""
        return {"estimate": self.estimate, "ci90": list(self.ci90), "unit": self.unit}


def sigmas(finding: Finding) -> float:
    """How many standard errors a finding is from none."""
    return abs(finding.size) / max((finding.ci90[1] - finding.ci90[0]) / (2.0 * NINETY), 1e-9)


def nats(findings: list[Finding], label: str) -> float:
    """Evidence of a label by the readings alone."""
    return 0.5 * max((sigmas(one) ** 2 for one in findings if one.label == label), default=0.0)


def sizes(findings: list[Finding]) -> dict[str, dict[str, Size]]:
    """By label of the catalogue, in the order of the findings, the parameters whose size readings say.

    Of several findings of one parameter the most certain counts, but for gyros whose axes have one scale. A compass's
    error has more parameters than its finding has sizes: it has none here.
    """
    found: dict[str, dict[str, Size]] = {one.label: {} for one in findings if one.label is not None}
    for one in sorted(findings, key=sigmas):
        if one.label is None or one.label == "compass":
            continue
        parameters = {parameter.name: parameter.unit for parameter in catalogue()[one.label].parameters}
        axis = one.channel.partition("_")[0]
        name = axis if axis in parameters else next(iter(parameters))
        found[one.label][name] = Size(one.size, one.ci90, parameters[name])
    scale = one_scale([one for one in findings if one.label == "gyro_scale"])
    if scale is not None:
        found["gyro_scale"] = {"scale": Size(scale[0], scale[1:], "1")}
    return found
