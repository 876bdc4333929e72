"""Noise of sensors and of the model from the filter's likelihood along healthy runs."""

from collections.abc import Callable

import numpy as np

from glider.tools.own.observer import Observer

LEVEL_ROWS, PLAIN_ROWS = 3_000, 600  # of runs from which noise levels are found: compiled, plain Python
LEVEL_STEPS = (0.8, 0.4)  # e-folds
MAX_LEVEL_SHIFT = 4.0  # e-folds from the file's noise, at most


def fit_levels(observer: Observer, say: Callable[[str], None]) -> None:
    """Noise of sensors and of the model by the filter's likelihood: coordinate steps, shortened.

    They say how far the filter that finds where windows begin trusts the model; no evidence hangs on them.
    """
    if observer.vehicle.level == 0:
        return
    declared, budget = observer.declared, LEVEL_ROWS if observer.vehicle.kernels.compiled else PLAIN_ROWS
    used, rows = list[int](), 0
    for n in sorted(range(len(observer.runs)), key=lambda n: len(observer.runs[n].t)):
        if used and rows + len(observer.runs[n].t) > budget:
            break
        used.append(n)
        rows += len(observer.runs[n].t)
    free = [("density", n) for n in range(len(declared.noises)) if declared.noises[n].density > 0.0]
    free += [("variance", n) for n in range(len(declared.outputs))]
    level = dict.fromkeys(free, 0.0)

    def cost() -> float:
        total = 0.0
        for n in used:
            point = observer.point.copy()
            for (what, k), shift in level.items():
                getattr(point, what)[k] *= np.exp(shift if what == "density" else 2.0 * shift)
            total += observer.filter(n, point).value
        return total + sum(shift**2 for shift in level.values()) / MAX_LEVEL_SHIFT**2 * 4.0

    best = cost()
    for size in LEVEL_STEPS:
        for one in free:
            for sign in (1.0, -1.0):
                moved_any = False
                while abs(level[one] + sign * size) <= MAX_LEVEL_SHIFT:
                    level[one] += sign * size
                    tried = cost()
                    if tried < best - 0.5:
                        best, moved_any = tried, True
                    else:
                        level[one] -= sign * size
                        break
                if moved_any:
                    break
    for (what, k), shift in level.items():
        getattr(observer.point, what)[k] *= np.exp(shift if what == "density" else 2.0 * shift)
    said = [f"{declared.noises[k].name if what == 'density' else declared.outputs[k].name} x{np.exp(shift):.2g}"
            for (what, k), shift in level.items() if abs(shift) > 0.3]  # fmt: skip
    say(f"noise levels: {', '.join(said) or 'as the file has them'}")
