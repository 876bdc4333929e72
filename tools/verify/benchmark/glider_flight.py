"""Today's practice on an ocean glider's dives, for comparison: fit drag and volume, and look whether the drag moves.

The quasi-steady glide of Merckelbach and others (2010), their equations (1) to (7), solved by iteration with SciPy;
volume and parasitic drag by least squares of the depth rate (their section 3c), over the reference dives and then the
drag alone over each dive. A dive is called changed where its drag leaves the median of the reference dives by more than
THRESHOLD robust standard deviations (1.4826 times their median absolute deviation). Nothing here is shared with the
observer: it takes run columns and the numbers of a vehicle file.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from glider.sim_backend.ocean.vehicle import OceanVehicle, gravity
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run

THRESHOLD = 3.0  # robust standard deviations
ROBUST = 1.4826  # median absolute deviation of a normal deviate to its standard deviation
EVEN = 10.0  # s, to which a dive is brought
DEPTH_RATE_SAMPLES = 7  # samples of a slope of the depth
ENDS = 0.1  # share of the depth at either end that is left out
SHALLOWEST_DEPTH, FLATTEST_PITCH, STEEPEST_PITCH = 10.0, np.radians(11.0), np.radians(45.0)
SETTLING_S = 60.0  # s behind a move of the engine
MOVED = 5e-6  # m3 from one even sample to the next: the engine moves
MIN_DIVE_SAMPLES = 20  # samples of a dive
ITERATIONS = 8  # of the angle of attack
REFERENCE_SPEED = 0.25  # m/s: speed at which a drag that is no square law is reported


@dataclass
class Glide:
    """The samples of a dive that are taken for steady: (n,) each, SI, depth rate up positive."""

    pitch: np.ndarray
    density: np.ndarray
    temperature: np.ndarray
    pressure: np.ndarray
    oil: np.ndarray
    rise: np.ndarray


@dataclass
class Practice:
    """What the fit says of a mission."""

    drag: np.ndarray  # (dives,) NaN where a dive has too few samples
    changed: np.ndarray  # (dives,) bool
    volume: float  # m3, of the reference dives; NaN where none has enough samples
    reference_drag: float  # of them all


def even_samples(run: Run) -> Glide | None:
    """A dive's samples, evenly in time; None where a column is missing."""
    t = run.t
    wanted = (names.DEPTH, names.ATTITUDE[1], names.OIL, names.DENSITY)
    columns = dict(run.columns)
    for name in wanted:
        if name not in columns or np.isfinite(columns[name]).sum() < 2:
            return None
    columns.setdefault(names.TEMPERATURE, np.full(len(t), 10.0))
    s = np.arange(t[0], t[-1], EVEN)
    if len(s) < 2 * DEPTH_RATE_SAMPLES:
        return None

    def evened(name: str) -> np.ndarray:
        values = columns[name]
        given = np.isfinite(values)
        return np.interp(s, t[given], values[given])

    from scipy.signal import savgol_filter

    depth, pitch, oil = (evened(name) for name in wanted[:3])
    rise = -savgol_filter(depth, DEPTH_RATE_SAMPLES, 1, deriv=1, delta=EVEN)
    moving = np.abs(np.gradient(oil)) > MOVED
    reach = int(SETTLING_S / EVEN)
    moving = np.convolve(moving, np.ones(2 * reach + 1), mode="same") > 0.5
    deepest = float(depth.max())
    steady = ~moving & (np.abs(pitch) > FLATTEST_PITCH) & (np.abs(pitch) < STEEPEST_PITCH) & (rise * pitch > 0.0)
    steady &= (depth > max(SHALLOWEST_DEPTH, ENDS * deepest)) & (depth < (1.0 - ENDS) * deepest)
    given = np.isfinite(columns[names.DENSITY])
    holes = np.abs(s[:, None] - t[given][np.clip(np.searchsorted(t[given], s)[:, None] - [0, 1], 0, given.sum() - 1)])
    steady &= holes.min(axis=1) < 120.0
    density, temperature = evened(names.DENSITY), evened(names.TEMPERATURE)
    return Glide(*(values[steady] for values in (pitch, density, temperature, 1e4 * depth, oil, rise)))


def rises(vehicle: OceanVehicle, glide: Glide, drag: float, volume: float) -> np.ndarray:
    """Vertical velocity up, m/s, of steady glides with a parasitic drag and a volume, (n,)."""
    hull, water, turned = vehicle.buoyancy, vehicle.hydrodynamics, vehicle.attitude
    pitch = (glide.pitch - turned.pitch_offset) / turned.pitch_scale
    strain = -hull.compressibility * glide.pressure
    strain = strain + hull.thermal_expansion * (glide.temperature - hull.reference_temperature)
    lifted = glide.density * (volume * (1.0 + strain) + hull.oil_scale * glide.oil) - hull.mass
    force, side = gravity(vehicle.latitude) * lifted, np.sign(pitch)
    steep, attack = np.abs(pitch), np.full(len(pitch), 0.03)
    speed, parasitic = np.full(len(pitch), REFERENCE_SPEED), np.full(len(pitch), drag)
    for _ in range(ITERATIONS):
        q = 0.5 * glide.density * speed**2
        parasitic = drag * (np.maximum(q, 1.0) / 32.0) ** water.drag_exponent
        whole = parasitic + water.Cd1 * attack**2
        attack = np.clip(whole / (water.lift_slope * np.tan(steep + attack)), 0.0, 0.25)
        along = np.maximum(force * side * np.sin(steep + attack), 0.0)
        speed = np.sqrt(along / (0.5 * glide.density * water.area * whole)) + 1e-6
    return side * speed * np.sin(steep + attack)


def fitted(vehicle: OceanVehicle, glides: list[Glide]) -> tuple[float, float]:
    """Drag and volume of dives by least squares of the depth rate."""
    start = vehicle.hydrodynamics.Cd0, vehicle.buoyancy.volume

    def misfit(x: np.ndarray) -> np.ndarray:
        drag, volume = start[0] * np.exp(x[0]), start[1] * (1.0 + 1e-3 * x[1])
        return np.concatenate([one.rise - rises(vehicle, one, drag, volume) for one in glides])

    # far from its volume a glider does not fly, and has no slope: the best of a few is where it begins
    begins = [np.array([0.0, share]) for share in np.linspace(-10.0, 10.0, 41)]
    begin = min(begins, key=lambda x: float(np.square(misfit(x)).sum()))
    found = least_squares(misfit, begin, x_scale=[0.1, 0.1], loss="soft_l1", f_scale=0.02).x
    return float(start[0] * np.exp(found[0])), float(start[1] * (1.0 + 1e-3 * found[1]))


def drag_of(vehicle: OceanVehicle, glide: Glide, drag: float, volume: float) -> float:
    """The drag of one dive, volume as it was found."""

    def misfit(x: np.ndarray) -> np.ndarray:
        return glide.rise - rises(vehicle, glide, drag * np.exp(x[0]), volume)

    return float(drag * np.exp(least_squares(misfit, [0.0], x_scale=[0.1], loss="soft_l1", f_scale=0.02).x[0]))


def practise(vehicle: OceanVehicle, runs: list[Run], reference: int) -> Practice:
    """A mission whose first `reference` dives are taken as unchanged."""
    glides = [even_samples(run) for run in runs]
    usable = [one is not None and len(one.rise) >= MIN_DIVE_SAMPLES for one in glides]
    first = [n for n in range(reference) if usable[n]]
    drag, changed = np.full(len(runs), np.nan), np.zeros(len(runs), dtype=bool)
    if not first:
        return Practice(drag, changed, np.nan, np.nan)
    whole, volume = fitted(vehicle, [one for n in first if (one := glides[n]) is not None])
    for n, one in enumerate(glides):
        if one is not None and usable[n]:
            drag[n] = drag_of(vehicle, one, whole, volume)
    middle = np.median(drag[first])
    spread = ROBUST * float(np.median(np.abs(drag[first] - middle)))
    changed[reference:] = np.abs(drag[reference:] - middle) > THRESHOLD * spread  # NaN is no change
    return Practice(drag, changed, volume, whole)


def water_rms(vehicle: OceanVehicle, runs: list[Run], drag: float, volume: float) -> float:
    """Root mean square of the depth rate less that of the glide, m/s, over the steady samples of runs."""
    glides = [one for run in runs if (one := even_samples(run)) is not None and len(one.rise) >= MIN_DIVE_SAMPLES]
    left = np.concatenate([one.rise - rises(vehicle, one, drag, volume) for one in glides])
    return float(np.sqrt(np.mean(left**2)))
