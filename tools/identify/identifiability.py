"""Unidentifiable directions: combinations of parameters as wide as their prior, and what would help."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS
from glider.tools.inference.vehicle_parameters import Parameters

UNIDENTIFIABLE_PRIOR_SHARE = 0.5  # of the prior's sigma: a combination that stays wider is unidentifiable
LOADING = 0.3  # of a combination, for a parameter to be named in it
WORDS = {
    "K_D0": "drag at no angle", "K_D": "drag growing with the angle of attack", "K_L0": "lift at no angle",
    "K_L": "lift slope", "K_beta": "side force", "K_MR": "rolling moment of sideslip", "K_p": "roll damping",
    "K_M0": "pitch moment at no angle", "K_M": "pitch moment's slope", "K_q": "pitch damping",
    "K_MY": "weathercock moment", "K_r": "yaw damping", "ballast_scale": "what the ballast's draw-wire means",
    "slider_scale": "what the slider's draw-wire means", "net_mass": "trim (net mass)",
}  # fmt: skip
HELP = {
    "K_D0": "straight glides at several ballasts, pitch held shallow", "K_D": "steep and shallow glides in turn",
    "K_L0": "dives and climbs at the same angle", "K_L": "glides at several pitch angles with motion capture",
    "K_beta": "spirals at full servo with motion capture", "K_MR": "servo steps from side to side at speed",
    "K_p": "quick servo steps at full ballast", "K_M0": "dives and climbs at the same slider setting",
    "K_M": "slider held at three settings on either side", "K_q": "quick slider steps at full ballast",
    "K_MY": "spirals at two servo angles", "K_r": "servo reversals at full ballast",
    "ballast_scale": "a weighing of the tank against its draw-wire",
    "slider_scale": "a ruler along the slider against its draw-wire",
    "net_mass": "a minute of neutral buoyancy at rest",
}  # fmt: skip


@dataclass(frozen=True)
class Unidentifiable:
    """An unidentifiable combination: its width over the prior's, its parameters with their shares, what would help."""

    width: float
    parts: tuple[tuple[str, float], ...]
    help: str

    def plain(self) -> dict[str, Any]:
        return {"width": self.width, "parts": dict(self.parts), "would_help": self.help}

    def sentence(self) -> str:
        names = " with ".join(f"{name} ({share:+.2f})" for name, share in self.parts)
        return f"{names}: stays at {100 * self.width:.0f} % of its prior width. Would help: {self.help}."


def looked_for(free: Parameters) -> list[int]:
    """The parameters that an identification is for: coefficients, trim, and what draw-wires mean."""
    return [n for n, name in enumerate(free.names) if name in WORDS]


def unidentifiable_directions(free: Parameters, draws: np.ndarray) -> list[Unidentifiable]:
    """Combinations wider than UNIDENTIFIABLE_PRIOR_SHARE of the prior, widest first. draws (k, n), in units of the
    priors.
    """
    listed = looked_for(free)
    values, vectors = np.linalg.eigh(np.cov(draws[:, listed].T))
    found = []
    for value, vector in sorted(zip(values, vectors.T, strict=True), key=lambda pair: -pair[0]):
        width = float(np.sqrt(max(value, 0.0)))
        if width < UNIDENTIFIABLE_PRIOR_SHARE:
            break
        order = np.argsort(-np.abs(vector))
        parts = [(free.names[listed[i]], float(vector[i])) for i in order if abs(vector[i]) >= LOADING]
        parts = parts or [(free.names[listed[order[0]]], float(vector[order[0]]))]
        if parts[0][1] < 0.0:
            parts = [(name, -share) for name, share in parts]
        found.append(Unidentifiable(width, tuple(parts), HELP[parts[0][0]]))
    return found


def sentences(free: Parameters, draws: np.ndarray) -> list[str]:
    """In plain words, coefficient by coefficient: what the runs identify and what not."""
    spread = draws.std(axis=0)
    known = [n for n in looked_for(free) if spread[n] < UNIDENTIFIABLE_PRIOR_SHARE]
    unknown = [n for n in looked_for(free) if spread[n] >= UNIDENTIFIABLE_PRIOR_SHARE]

    def words(which: list[int]) -> str:
        return ", ".join(f"{WORDS[free.names[n]]} ({free.names[n]})" for n in which)

    found = [f"These runs identify: {words(known)}."] if known else []
    if unknown:
        found.append(f"They do not identify: {words(unknown)}; what is printed for these is mostly the prior.")
    elif len(known) >= len(COEFFICIENTS):
        found.append("No coefficient is left to its prior.")
    return found
