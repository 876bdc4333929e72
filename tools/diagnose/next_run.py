"""The next run: the manoeuvre whose outcome the leading explanations predict most differently.

A handful of safe manoeuvres are flown by each explanation's model, open loop and from the same start, as the windows of
the gap are; two explanations are as far apart as their predictions in tolerances. The manoeuvre that parts the least
separated pair best is proposed, as a mission file for `glider fly`.
"""

from dataclasses import dataclass, replace

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.firmware.core.vehicle.layout import X_DOWN, X_NU, X_QUAT
from glider.firmware.core.vehicle.mass import roll_pendulum_moment
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.search import Search
from glider.tools.inference.problem import Problem

SECONDS, RATE = 90.0, 10.0  # s, Hz
EXPLANATIONS = 3
MISSION = """# Proposed to part: {parts}.
format = 1
name = "{name}"
description = "{text}"
time_limit_s = 600.0

[site]
name = "as flown"
depth_m = {site:.1f}
"""
LEG = """
[[leg]]
depth_m = {depth:.1f}
pitch_deg = {pitch:.1f}
roll_deg = {roll:.1f}
ballast_kg = {ballast:.2f}
time_limit_s = 120.0
"""


@dataclass(frozen=True)
class Manoeuvre:
    """Dives and climbs: pitch (deg) down and up, roll (deg) in each, ballast (kg), and how often."""

    name: str
    text: str
    pitch: float
    roll: tuple[float, float]
    ballast: float
    count: int


MANOEUVRES = (
    Manoeuvre("gentle", "flat dives and climbs straight ahead", 15.0, (0.0, 0.0), 0.10, 2),
    Manoeuvre("steep", "steep dives and climbs straight ahead", 35.0, (0.0, 0.0), 0.18, 2),
    Manoeuvre("short", "short steep dives and climbs: many reversals of pump and slider", 30.0, (0.0, 0.0), 0.18, 4),
    Manoeuvre("starboard", "a turn to starboard, down and up", 25.0, (35.0, 35.0), 0.15, 2),
    Manoeuvre("weave", "dives rolled to starboard, climbs to port", 25.0, (30.0, -30.0), 0.15, 2),
)


def commands(vehicle, manoeuvre: Manoeuvre, t: np.ndarray) -> np.ndarray:
    """Open-loop commands (rows, 3) of a manoeuvre: pendulum and water moments balanced at its pitch and roll."""
    m = vehicle.mass
    half = SECONDS / (2 * manoeuvre.count)
    phase = (t // half).astype(int)
    diving = phase % 2 == 0
    ballast = np.where(diving, manoeuvre.ballast, -manoeuvre.ballast)
    sr = roll_pendulum_moment(vehicle.vector())
    pitch = np.radians(np.where(diving, -manoeuvre.pitch, manoeuvre.pitch))
    slider = -(sr * np.tan(pitch) + ballast * m.x_b) / m.m_s
    servo = np.radians(np.where(diving, manoeuvre.roll[0], manoeuvre.roll[1]))
    low, high = vehicle.actuators.slider.range
    return np.stack([servo, np.clip(slider, low, high), ballast], axis=1)


def flown(problem: Problem, models: list, manoeuvre: Manoeuvre) -> np.ndarray:
    """What each model (P, F) foresees of a manoeuvre, (models, rows, N_Y), without noise."""
    t = np.arange(int(SECONDS * RATE)) / RATE
    start = np.zeros((1, ef.N_XF))
    start[0, X_DOWN], start[0, X_QUAT], start[0, X_NU] = 1.0, 1.0, 0.1
    one = problem.part(0)
    recording = replace(
        one.recording, bounds=np.array([0, len(t)]), modes=np.zeros(1, dtype=np.int64), t=t,
        inputs=commands(problem.case.roughie, manoeuvre, t),
    )  # fmt: skip
    still = replace(
        one, recording=recording, z=np.zeros((len(t), ef.N_Y)), spectral=np.zeros_like(one.spectral),
        R=np.zeros((1, ef.N_Y)), valid=np.ones((len(t), ef.N_Y), dtype=bool), stamps=t,
    )  # fmt: skip
    rng = np.random.default_rng(0)
    return np.array([still.simulated(P, F, start, rng) for P, F in models])


def distance(problem: Problem, a: np.ndarray, b: np.ndarray) -> float:
    """How far two predictions lie apart: root mean square over the channels recorded, in tolerances."""
    seen = problem.seen
    squares = []
    for channel in problem.kind.measures.channels:
        columns = [c for c in channel.columns if seen[c]]
        if columns:
            difference = a[:, columns] - b[:, columns]
            difference = wrap(difference) if channel.wrapped else difference
            squares.append(float(np.mean((difference / channel.tolerance) ** 2)))
    return float(np.sqrt(np.mean(squares)))


def propose(search: Search) -> tuple[dict, str]:
    """The `next_run` entry of diagnosis.json and the text of its mission file."""
    problem = search.problem
    leading = [search.null, *search.ranked()]
    kept = [c for n, c in enumerate(leading) if c.labels not in [d.labels for d in leading[:n]]]
    kept = sorted(kept, key=lambda c: -c.log_evidence(search.fitter))[:EXPLANATIONS]
    names = ["+".join(c.labels) or "none" for c in kept]
    models = [search.model(c) for c in kept]
    best, apart = MANOEUVRES[0], -1.0
    for manoeuvre in MANOEUVRES:
        Y = flown(problem, models, manoeuvre)
        pairs = [distance(problem, Y[i], Y[j]) for i in range(len(Y)) for j in range(i)]
        least = min(pairs, default=0.0)
        if np.isfinite(least) and least > apart:
            best, apart = manoeuvre, least
    deepest = float(np.nanmax(problem.z[:, ef.Y_DEPTH])) if problem.valid[:, ef.Y_DEPTH].any() else 5.0
    deep = max(2.0, round(deepest, 1))
    text = MISSION.format(parts=", ".join(names), name=f"part_{best.name}", text=best.text, site=deep + 1.5)
    for _ in range(best.count):
        text += LEG.format(depth=deep, pitch=-best.pitch, roll=best.roll[0], ballast=best.ballast)
        text += LEG.format(depth=1.0, pitch=best.pitch, roll=best.roll[1], ballast=-best.ballast)
    entry = {
        "manoeuvre": best.name, "description": best.text, "parts": names, "distance": apart,
        "mission": "next_run.toml",
    }  # fmt: skip
    return entry, text
