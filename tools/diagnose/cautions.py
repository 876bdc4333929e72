"""What a case cannot say, in plain words: columns that are not there, stretches without samples, one run, a bad fit."""

from collections.abc import Mapping

import numpy as np

from glider.firmware.model.vehicle import PLACES
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.first_vehicle import in_words
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.sampling import missing_share, own_period
from glider.tools.diagnose.noise_probes import UNPREDICTABLE
from glider.tools.inference.levels import factors
from glider.tools.inference.parameters import effect_parameters
from glider.tools.inference.problem import Problem

SPARSE, LONG = 0.2, 5.0  # share missing of the samples at the sensor's own rate; s without a sample
ASSUMED_NUMBERS = "the vehicle file has assumed numbers"  # how that caution begins
NOISE_FACTOR_REPORTED = 1.25  # times what a file says of noise, or less by as much
PARTS = {
    "onboard attitude": names.ATTITUDE, "gyro": names.RATES, "depth": (names.DEPTH,), "draw-wires": names.DRAW_WIRES,
    "motion capture": names.MOCAP_POSITION,
}  # fmt: skip
WITHOUT = {
    "onboard attitude": "errors of the attitude sensor cannot be seen",
    "gyro": "errors of the gyro cannot be seen, and quick effects less sharply",
    "depth": "errors of the pressure sensor cannot be seen",
    "draw-wires": "slider and ballast are taken to follow their commands",
    "motion capture": "a steady current and errors common to all onboard sensors cannot be seen",
}


def cautions(problem: Problem) -> list[str]:
    """Everything about these runs that limits what can be concluded, a line each."""
    found = [*_assumed(problem), *_without_commands(problem), *_without_columns(problem), *_holes(problem)]
    return [*found, *_few(problem), *_noise(problem)]


def not_asked(problem: Problem) -> list[str]:
    """Labels that these runs cannot show at all, and that are therefore not among the causes tried."""
    tried = effect_parameters(problem)
    return [label for label in catalogue() if label not in tried and label not in UNPREDICTABLE]  # asked otherwise


def _assumed(problem: Problem) -> list[str]:
    """Numbers of the vehicle that nobody measured: what one of them may do is no cause."""
    guessed = [name for name in problem.case.assumed if name in PLACES]
    if not guessed:
        return []
    return [
        f"{ASSUMED_NUMBERS} ({in_words(guessed)}): what they may do cannot be distinguished from a "
        "cause; `glider identify` on healthy runs first, then diagnose by identified.toml"
    ]


def _without_commands(problem: Problem) -> list[str]:
    missing_noise = [run.name for run in problem.runs if not run.has_commands]
    if not missing_noise:
        return []
    where = "" if len(missing_noise) == len(problem.runs) else f" in {', '.join(missing_noise)}"
    return [
        f"no commands{where}: the flights are driven by the draw-wires, the servo is guessed, and how actuators follow "
        "their commands cannot be judged"
    ]


def _without_columns(problem: Problem) -> list[str]:
    found = []
    for part, wanted in PARTS.items():
        missing_noise = [run.name for run in problem.runs if not any(name in run.columns for name in wanted)]
        partly = [
            (run.name, [name for name in wanted if name not in run.columns])
            for run in problem.runs
            if run.name not in missing_noise and not run.has(*wanted)
        ]
        if missing_noise:
            where = "" if len(missing_noise) == len(problem.runs) else f" in {', '.join(missing_noise)}"
            found.append(f"no {part}{where}: {WITHOUT[part]}")
        for run, missing in partly:
            found.append(f"{run}: column {', '.join(missing)} is missing: what it would show cannot be seen")
    return found


def _holes(problem: Problem) -> list[str]:
    """Columns with many samples missing, or none for long; motion capture's short blind spells are usual."""
    found = []
    for run in problem.runs:
        holed = []
        for name, values in run.columns.items():
            if name == names.TIME or name in names.COMMANDS:
                continue
            ok = np.isfinite(values)
            if not ok.any():
                holed.append(f"{name} (no sample)")
                continue
            at = np.concatenate([run.t[:1], run.t[ok], run.t[-1:]])
            longest, missing = float(np.diff(at).max()), missing_share(run.t, values)
            if missing > SPARSE or longest > max(LONG, 2.0 * own_period(run.t, values)):
                holed.append(f"{name} ({100.0 * missing:.0f} % missing, up to {longest:.0f} s)")
        if holed:
            found.append(f"{run.name}: {', '.join(holed)}: less can be seen there")
    return found


def below_floor(floor: Mapping[str, float], why: str = "noise and disturbance alone leave") -> list[str]:
    """Whether the floor hides what would be a gap: a line where that of a channel or the total is above 1 tolerance."""
    high = {name: value for name, value in floor.items() if value > 1.0}
    if not high:
        return []
    said = [f"{value:.2g}" if name == "total" else f"{name} {value:.2g}" for name, value in high.items()]
    where = said[-1] if "total" in high else ", ".join(said)
    return [f"{why} {where} tolerances: a gap below that cannot be seen in these runs"]


def _noise(problem: Problem) -> list[str]:
    """Noise that is not what the case says."""
    differs = [
        f"{name.replace('_', ' ')} {factor:.2g}"
        for name, factor in factors(problem).items()
        if abs(np.log(factor)) > np.log(NOISE_FACTOR_REPORTED)
    ]
    if not differs:
        return []
    return [f"noise is not what the vehicle file says: {', '.join(differs)} times that (taken from these runs)"]


def _few(problem: Problem) -> list[str]:
    found = []
    if len(problem.runs) == 1:
        found.append("one run only: figures after a fit are of the run that was fitted, and not checked on other data")
    look_in = problem.kind.measures.look_in
    short = [run.name for run in problem.runs if run.t[-1] - run.t[0] <= look_in]
    if short:
        found.append(f"{', '.join(short)}: no longer than {look_in:g} s, so that nothing of it is scored")
    return found
