"""The vehicle of equation (4) that is nearest to one of another form: what it leaves is the healthy residual.

The coefficients are fitted by least squares to the water's forces along the true flights. Then coefficients, added
masses and added inertias are refined by a few Gauss-Newton steps on the windows flown on from true starts. The fit uses
the true states, which no identification has.
"""

import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.water import water_wrench
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.lifting_body import body_wrench
from glider.tools.gap.measure import scored_rows
from glider.tools.inference.channels import ROUGHIE_MEASURES, errors
from glider.tools.verify.challenge.form_vehicle import COEFFICIENTS
from glider.tools.verify.challenge.trial import Trial, TrialFlight, total

EVERY = 5  # rows
FORCE, MOMENT = 0.3, 0.03  # N, N m: what counts as much
STEPS, DAMPING, DIFFERENCE_STEP = 3, 1e-3, 1e-2
FITTED_PLACES = (
    *range(COEFFICIENTS.start, COEFFICIENTS.stop), layout.A_X, layout.A_Y, layout.A_Z, layout.B_Y, layout.B_Z,
)  # fmt: skip


def formless(F: np.ndarray) -> np.ndarray:
    """F with the water's forces of equation (4)."""
    F = F.copy()
    F[fo.FB_ON] = 0.0
    return F


def fit_forces(trial: Trial, flights: list[TrialFlight]) -> np.ndarray:
    """P with the coefficients whose forces along the true flights are nearest to the body's, (N_P,)."""
    columns = range(COEFFICIENTS.start, COEFFICIENTS.stop)
    weights = np.repeat([1.0 / FORCE, 1.0 / MOMENT], 3)
    units = []
    for place in columns:
        P = np.zeros(layout.N_P)
        P[place] = 1.0
        units.append(P)
    rows, wanted = [], []
    for flight in flights:
        for x in flight.X[::EVERY, 7:13]:
            wanted.append(weights * body_wrench(trial.shapes, *x))
            rows.append(np.stack([weights * water_wrench(P, *x) for P in units], axis=1))
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(wanted), rcond=None)[0]
    P = trial.P.copy()
    P[COEFFICIENTS] = found
    return P


def misses(trial: Trial, flights: list[TrialFlight], P: np.ndarray) -> np.ndarray:
    """What a vehicle of equation (4) misses in all scored samples, in tolerances; NaN where nothing was measured."""
    found, F = [], formless(trial.shapes)
    for flight in flights:
        Y, table = trial.predict(flight, P, F, plain=True), ROUGHIE_MEASURES.measured(flight.run)
        rows = scored_rows(flight.windows, flight.run.rows)
        found += [errors(one, table, Y)[rows].ravel() for one in ROUGHIE_MEASURES.channels_of(flight.run)]
    return np.concatenate(found)


def fit_flights(trial: Trial, flights: list[TrialFlight], P: np.ndarray) -> np.ndarray:
    """P refined so that windows flown on from true starts come nearest to the flights, (N_P,)."""
    scale = np.maximum(np.abs(P[list(FITTED_PLACES)]), 0.1)
    best = misses(trial, flights, P)
    valid, damping = np.isfinite(best), DAMPING
    for _ in range(STEPS):
        columns = []
        for place, size in zip(FITTED_PLACES, scale, strict=True):
            moved = P.copy()
            moved[place] += DIFFERENCE_STEP * size
            columns.append((misses(trial, flights, moved) - best)[valid] / DIFFERENCE_STEP)
        J = np.nan_to_num(np.stack(columns, axis=1))
        normal = J.T @ J
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), -J.T @ best[valid])
        moved = P.copy()
        moved[list(FITTED_PLACES)] += scale * np.clip(step, -0.5, 0.5)
        found = misses(trial, flights, moved)
        if not np.isfinite(found[valid]).all() or np.square(found[valid]).sum() >= np.square(best[valid]).sum():
            damping *= 100.0
            continue
        P, best = moved, found
    return P


def residual(trial: Trial, flights: list[TrialFlight], P: np.ndarray) -> float:
    """Total gap that a vehicle of equation (4) leaves in healthy flights, from true starts."""
    return total(trial.channels(flights, P, formless(trial.shapes), plain=True))
