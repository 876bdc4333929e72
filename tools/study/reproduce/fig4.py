"""Figure 4: the paper's 45 runs flown by the project's plant, captured, identified; the truth is marked."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS, Vehicle
from glider.tools.data.files import whole
from glider.tools.data.runs.case import load_case
from glider.tools.identify.design import write_design
from glider.tools.identify.pipeline import identify
from glider.tools.inference.vehicle_parameters import coefficient_sizes
from glider.tools.report.identified import marginals

SEED = 4


def reproduce_fig4(vehicle_name: str, vehicle: Vehicle, out: Path) -> dict[str, Any]:
    """The twelve marginals as a picture, and the truth beside what was found."""
    with tempfile.TemporaryDirectory() as folder:
        world = write_design(Path(folder) / "case", vehicle_name, vehicle, SEED)
        found = identify(load_case(Path(folder) / "case"), SEED)
    truth, sizes = world.coefficients(), coefficient_sizes(vehicle.vector())
    picture = out / "fig4.png"
    figure = marginals(found, truth)
    with whole(picture) as (temporary,):
        figure.savefig(temporary, format="png", dpi=130)
    table = [
        {
            "name": one.name, "truth": truth[one.name], "mean": one.mean, "sd": one.sd,
            "error_pct_of_size": 100.0 * abs(one.mean - truth[one.name]) / size,
            "held": float(one.ci90[0] <= truth[one.name] <= one.ci90[1]),
        }
        for one, size in zip(found.coefficients, sizes, strict=True)
    ]  # fmt: skip
    held = int(sum(row["held"] for row in table))
    median = float(np.median([row["error_pct_of_size"] for row in table]))
    return {
        "figure": "fig4",
        "cases": table,
        "noise": vehicle.disturbance.linear,
        "table": table,
        "runs": len(found.runs),
        "seconds": found.seconds,
        "says": (
            f"{held} of {len(COEFFICIENTS)} 90 % intervals hold the truth, median error {median:.2g} % of the "
            "coefficient's size; every marginal has one peak"
            if _single(found) else f"{held} of {len(COEFFICIENTS)} 90 % intervals hold the truth"
        ),
        "picture": str(picture),
    }  # fmt: skip


def _single(found) -> bool:
    """Whether every coefficient's marginal falls away on both sides of one peak, up to the noise of its bins."""
    draws = found.free.si(found.chains.flat)
    for n in range(len(COEFFICIENTS)):
        counts, _ = np.histogram(draws[:, n], bins=15)
        top = int(np.argmax(counts))
        slack = 4.0 * np.sqrt(counts.max())
        if (np.diff(counts[: top + 1]) < -slack).any() or (np.diff(counts[top:]) > slack).any():
            return False
    return True
