"""P(unknown) of docs/explanation/diagnosis.md, Decision rule, computed from the page's formulas alone.

Compared with the program on ten cases, of which some have their residual at one element.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.diagnose.gates import opened
from glider.tools.diagnose.noise_probes import NoiseProbe, ProbeResult
from glider.tools.diagnose.unknown import Remainder, probability_unknown

SENSOR, HULL, OTHER = ("sensing", "gyro"), ("hydrodynamics", "surge"), ("actuation", "servo")


def phi(x, m, s):
    z = (math.log(max(x, 1e-300)) - math.log(m)) / s
    return min(max(0.5 * math.erfc(-z / math.sqrt(2.0)), 0.002), 0.998)


def gate(x, a, b):
    t = min(max(math.log(x / a) / math.log(b / a), 0.0), 1.0) if x > 0.0 else 0.0
    return t * t * (3.0 - 2.0 * t)


def by_the_page(c):
    """Probability of an unknown effect: gaps, gains, certainty of the noise, and where the residual is."""
    L_r = max(c["gains"].values())
    u_L = L_r / (L_r + c["L_s"])
    left = c["G_s"] ** 2 - c["G_f"] ** 2
    u_G = left / min(c["G_0"] ** 2 - c["G_f"] ** 2, left + c["D"])
    w = math.sqrt(left) / c["G_f"]
    F = {"other": phi(u_G, 0.145, 0.35), "file": phi(u_L, 0.145, 0.35)}
    W = {"other": phi(w, 1.8, 0.35), "file": phi(w, 0.8, 0.35)}
    place = max(c["gains"], key=c["gains"].get)
    r = L_r / sorted(c["gains"].values())[-2]
    p = {}
    for kind in F:
        p[kind] = max(F[kind] * W[kind], 0.002)
        if place[0] == "sensing" and place in c["places"]:
            p[kind] += (max(F[kind], phi(u_L, 0.03, 1.1)) - p[kind]) * gate(r, 2.0, 4.0)
    q = 0.002 + gate(c["sigma"], 6.0, 12.0) * (c["p_w"] * p["file"] + (1.0 - c["p_w"]) * p["other"] - 0.002)
    return q + (0.998 - q) * gate(c["G_s"], 3.0, 8.0)


def by_the_program(c):
    probed = [ProbeResult(NoiseProbe(place[1], "", *place), gain, 6.0) for place, gain in c["gains"].items()]
    probed.sort(key=lambda one: -one.gain)
    left = Remainder(c["L_s"], probed[0].gain, probed, opened(c["sigma"], 6.0))
    shrinkage = SimpleNamespace(before=c["G_0"], recalibrated=0.9 * c["G_0"], after=c["G_s"], floor=c["G_f"])
    search = SimpleNamespace(
        well_specified=c["p_w"], problem=SimpleNamespace(rules=SimpleNamespace(whiteness=True))
    )  # fmt: skip
    return probability_unknown(search, True, shrinkage, left, None, c["D"], c["places"])


def case(seed):
    """Figures of a diagnosis whose residual sits at a sensor, at the hull or at an actuator."""
    rng = np.random.default_rng(seed)
    floor = rng.uniform(0.1, 0.3)
    after = floor * rng.uniform(1.1, 20.0) if seed % 3 else floor * rng.uniform(1.05, 3.0)
    order = rng.permutation(3)
    gains = {place: 10.0 ** rng.uniform(1.0, 4.0) for place in (SENSOR, HULL, OTHER)}
    gains[(SENSOR, HULL, OTHER)[order[0]]] = 2e4
    places = [(SENSOR, HULL, OTHER)[n] for n in order[: 1 + seed % 2]] if seed % 4 else [OTHER, SENSOR]
    return {
        "G_f": floor, "G_s": after, "G_0": after * rng.uniform(1.1, 6.0), "D": after**2 * rng.uniform(0.2, 9.0),
        "L_s": 10.0 ** rng.uniform(3.0, 6.0), "gains": gains, "places": places, "p_w": rng.uniform(0.0, 1.0),
        "sigma": rng.uniform(5.0, 14.0),
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_the_rule_of_the_page_is_the_programs(seed):
    assert by_the_program(case(seed)) == pytest.approx(by_the_page(case(seed)), abs=1e-9)


def test_the_ten_cases_say_known_and_unknown():
    found = [by_the_page(case(seed)) for seed in range(10)]
    assert min(found) < 0.1
    assert max(found) > 0.9
    assert sum(0.1 < one < 0.9 for one in found) >= 2
