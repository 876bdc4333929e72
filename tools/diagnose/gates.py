"""Gates that open by degrees: where a figure decides which of two answers is given, both are, each with its weight.

An answer that jumps where a figure passes a limit says more than the figure does: a millionth of the noise can move it
across (docs/explanation/diagnosis.md, Steady).
"""

import numpy as np

from glider.firmware.model.vehicle import FormTable
from glider.tools.inference.hyperparameters import DIAGNOSIS


def form_stands_out(form: FormTable | None) -> bool:
    """Whether a vehicle was identified, and its form leaves more of healthy runs than noise does, in squares."""
    return form is not None and form.total**2 - form.noise**2 > form.noise**2


def opened(value: float, shut: float, wide: float | None = None) -> float:
    """How far a gate is open, 0 up to `shut` and 1 from `wide`; smooth in the logarithm of the value between.

    wide: `gate_width` times `shut`, unless it is given.
    """
    if value <= shut:
        return 0.0
    wide = DIAGNOSIS.gate_width * shut if wide is None else wide
    share = float(min(np.log(value / shut) / np.log(wide / shut), 1.0))
    return share * share * (3.0 - 2.0 * share)


def materiality(moved: float) -> float:
    """How far a movement of a channel (tolerances) is a gap, from 0 to 1."""
    return opened(moved, DIAGNOSIS.material)


def mixed(shares: dict[str, float], others: dict[str, float], weight: float) -> dict[str, float]:
    """Probabilities of two answers, the second with a weight."""
    names = dict.fromkeys([*shares, *others])
    return {name: (1.0 - weight) * shares.get(name, 0.0) + weight * others.get(name, 0.0) for name in names}
