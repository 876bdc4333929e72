"""Runs and model as later stages see them once the readings are compared with each other.

See docs/explanation/readings.md.

What an effect of the catalogue says (a scale of the gyro, a lag, an offset) goes into the model, which then reads as
the instrument does: what was recorded stays as it is. What no effect says (exchanged axes, a sign, degrees) is put
right in the runs.
"""

from dataclasses import dataclass, replace

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.errors import InputError
from glider.tools.data.intervals import NINETY
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.data.vehicle_kinds import kind_of
from glider.tools.inference.model import Model, effect_vector
from glider.tools.inference.vehicle_parameters import GAUGE
from glider.tools.readings.check import apply_corrections, check, corrected_runs
from glider.tools.readings.findings import Finding
from glider.tools.readings.signals import table_of
from glider.tools.readings.stretches import out_of_water, under_water

# effects of a constant size, by label: the one entry of F that a finding's size is
SIZED = {
    "attitude_lag": "ATTITUDE_LAG", "depth_lag": "DEPTH_LAG", "depth_offset": "DEPTH_OFFSET",
    "depth_scale": "DEPTH_SCALE", "pressure_lever": "DEPTH_LEVER", "imu_pitch_bias": "PITCH_BIAS",
    "imu_roll_bias": "ROLL_BIAS", "attitude_scale": "PITCH_SCALE",
}  # fmt: skip
# Axes of a gyro have one scale where they differ by less than standard errors, or than a share of it: the rate about
# the vertical is compared with a compass, whose errors that turn with the heading look like some of it.
NEAR_SIGMA, NEARLY = 3.0, 0.3


@dataclass(frozen=True)
class ReadingCorrections:
    """What was found, the runs with what only runs can be rid of, and the model that reads as the instruments do."""

    findings: list[Finding]
    runs: list[Run]
    model: Model
    added: list[str]  # labels that the model holds now, and what was put right in the runs
    scale: tuple[float, float, float] | None = None  # of the gyro, where its axes have one: error and 90 % interval

    @property
    def labels(self) -> list[str]:
        """Labels of the catalogue among what was added."""
        return [name for name in self.added if name in catalogue()]


def submerged(case: Case) -> Case:
    """The case without what was measured out of the water; readings are compared with each other before."""
    return replace(case, runs=[kind_of(case.vehicle).submerged(run) for run in case.runs])


def findings_of(runs: list[Run]) -> list[Finding]:
    """What the readings say of each other; nothing where there is nothing to compare."""
    try:
        return check(runs).findings
    except InputError:
        return []


def correct_readings(case: Case, model: Model, runs: list[Run] | None = None) -> ReadingCorrections:
    """The runs (all of the case, if none are given) and the model, by what the readings of the runs say."""
    runs = case.runs if runs is None else runs
    findings = findings_of(runs)
    F, added, rest = effect_vector(model), [], []
    for one in findings:
        if not one.mended or one.channel not in {*names.RATES, *names.ATTITUDE, names.DEPTH, "attitude"}:
            continue
        if one.label in SIZED:
            F[getattr(ef, SIZED[one.label])] += one.size
            added.append(one.label)
        elif one.label == "gyro_bias":
            F[ef.GYRO_P + names.RATES.index(one.channel)] += one.size
            added.append(one.label)
        elif one.channel == names.DEPTH and one.against == "ballast_kg":
            F[ef.GAUGE_TANK] += one.size
            added.append(GAUGE)
        elif one.label != "gyro_scale":
            rest.append(one)
    scale = one_scale([one for one in findings if one.label == "gyro_scale" and one.mended])
    if scale is not None:
        F[ef.GYRO_SCALE] += scale[0]
        added.append("gyro_scale")
    else:
        rest += [one for one in findings if one.label == "gyro_scale"]
    if rest:
        runs = corrected_runs(runs, apply_corrections(table_of(runs), rest))
        added += [f"{one.channel} {one.finding}" for one in rest]
    if any(out_of_water(run).any() for run in runs):
        runs = [under_water(run) for run in runs]
    return ReadingCorrections(
        findings, runs, replace(model, F=F if F.any() else model.F), list(dict.fromkeys(added)), scale
    )


def fix_axes_signs_units(runs: list[Run], findings: list[Finding]) -> list[Run]:
    """The runs with what no effect of the catalogue stands for put right: axes, signs, units."""
    wrong = [one for one in findings if one.mended and one.label is None and one.channel in names.ALL]
    return corrected_runs(runs, apply_corrections(table_of(runs), wrong)) if wrong else runs


def one_scale(found: list[Finding]) -> tuple[float, float, float] | None:
    """The scale error that the axes of a gyro share, with its 90 % interval; None where they differ or one says it.

    Weighed by certainty; the error is widened by as much as the axes scatter more than their errors.
    """
    if len(found) < 2:
        return None
    size = np.array([one.size for one in found])
    error = np.maximum([(one.ci90[1] - one.ci90[0]) / (2.0 * NINETY) for one in found], 1e-6)
    weight = error**-2.0
    mean = float((weight * size).sum() / weight.sum())
    apart = np.abs(size - mean)
    if not np.all((apart < NEAR_SIGMA * error) | (apart < NEARLY * abs(1.0 + mean))):
        return None
    scatter = max(1.0, float(np.sqrt((weight * apart**2).sum() / (len(found) - 1))))
    half = NINETY * scatter / float(np.sqrt(weight.sum()))
    return mean, mean - half, mean + half
