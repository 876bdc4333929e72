"""Twin experiments: how often the 90 % intervals hold the truth.

`python -m glider.tools.identify.simulated_sets` prints the figures.

Data sets of the project's own plant, each of another vehicle, another capture and another disturbance; each identified
by the trajectory likelihood and by the accelerations'.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS, Vehicle
from glider.tools.data.intervals import NINETY
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.identify.design import grid, write_design
from glider.tools.identify.pipeline import identify
from glider.tools.inference.vehicle_parameters import coefficient_sizes

RUNS = 5  # of the 45, drawn anew for each data set


def one(vehicle: Vehicle, seed: int, runs: int = RUNS) -> dict[str, dict[str, float]]:
    """A data set identified: for each coefficient whether its interval holds the truth, the error and sd in sizes."""
    picked = sorted(np.random.default_rng([seed, 9]).permutation(len(grid()))[:runs].tolist())
    with tempfile.TemporaryDirectory() as folder:
        world = write_design(Path(folder), "roughie", vehicle, seed, picked)
        found = identify(load_case(folder), seed)
    truth, sizes = world.coefficients(), dict(zip(COEFFICIENTS, coefficient_sizes(vehicle.vector()), strict=True))
    other = {entry["name"]: entry for entry in found.compared()}
    return {
        s.name: {
            "held": float(s.ci90[0] <= truth[s.name] <= s.ci90[1]),
            "error": abs(s.mean - truth[s.name]) / sizes[s.name],
            "z": (s.mean - truth[s.name]) / s.sd,
            "z_accelerations": (other[s.name]["mean"] - truth[s.name]) / other[s.name]["sd"],
            "heat": found.quadratic.inflation,
        }
        for s in found.coefficients
    }


def figures(sets: list[dict[str, dict[str, float]]]) -> dict:
    """Coverage over data sets and coefficients, by coefficient, and the errors' median."""

    def over(key: str, name: str | None = None) -> np.ndarray:
        return np.array([entry[key] for found in sets for n, entry in found.items() if name in (None, n)])

    return {
        "data_sets": len(sets),
        "coverage_90": float(over("held").mean()),
        "coverage_by_coefficient": {name: float(over("held", name).mean()) for name in COEFFICIENTS},
        "z_sd": float(over("z").std()),
        "median_error_pct_of_size": float(100.0 * np.median(over("error"))),
        "coverage_90_accelerations": float(np.mean(np.abs(over("z_accelerations")) < NINETY)),
        "heat": float(np.median(over("heat"))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=50)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--first-seed", type=int, default=1)
    given = parser.parse_args()
    vehicle, sets = load_vehicle("roughie"), []
    for seed in range(given.first_seed, given.first_seed + given.sets):
        sets.append(one(vehicle, seed, given.runs))
        held = sum(entry["held"] for entry in sets[-1].values())
        print(f"data set {seed}: {held:.0f} of {len(COEFFICIENTS)} held", file=sys.stderr)
    print(json.dumps(figures(sets), indent=1))


if __name__ == "__main__":
    main()
