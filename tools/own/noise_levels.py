"""Noise of sensors and of the model from the filter's likelihood along healthy runs."""

from collections.abc import Callable, Sequence

import numpy as np

from glider.tools.own.observer import ModelPoint, Observer

LEVEL_ROWS = 3_000  # of runs from which noise levels are found
LEVEL_STEPS = (0.8, 0.4)  # e-folds
MAX_LEVEL_SHIFT = 4.0  # e-folds from the file's noise, at most
PARTS_ASKED = 1.0, 0.75, 0.5, 0.25, 0.0  # of what the filter's likelihood asks for, in e-folds

Levels = dict[tuple[str, int], float]  # e-folds of a noise's density, or of an output's 1 sigma, by place


def fit_levels(
    observer: Observer, points: Sequence[ModelPoint], scales: np.ndarray, say: Callable[[str], None]
) -> None:
    """Noise of sensors and of the model by the filter's likelihood at every run's point: coordinate steps, shortened.

    They say how far the filter that finds where windows begin trusts the model; no evidence hangs on them. The filter
    takes what errors have in common for noise as well, and one that trusts nothing is lost: of what it asks for counts
    the part by which windows are predicted best, each run by the logarithm of its errors in units of `scales` (y,).
    """
    if observer.vehicle.level == 0:
        return
    declared = observer.declared
    asked = _most_probable(observer, points)

    def left(share: float) -> float:
        gaps = [observer.gaps(n, _at(point, asked, share), observer.horizon) / scales for n, point in enumerate(points)]
        return float(np.mean([np.log(np.nanmean(one**2)) for one in gaps]))

    share = min(PARTS_ASKED, key=left)
    observer.point = _at(observer.point, asked, share)
    said = [f"{declared.noises[k].name if what == 'density' else declared.outputs[k].name} x{np.exp(share * shift):.2g}"
            for (what, k), shift in asked.items() if abs(share * shift) > 0.3]  # fmt: skip
    say(f"noise levels: {', '.join(said) or 'as the file has them'}")


def _at(point: ModelPoint, levels: Levels, share: float = 1.0) -> ModelPoint:
    """A model with its noises at a share of levels."""
    found = point.copy()
    for (what, k), shift in levels.items():
        getattr(found, what)[k] *= np.exp(share * (shift if what == "density" else 2.0 * shift))
    return found


def _most_probable(observer: Observer, points: Sequence[ModelPoint]) -> Levels:
    """Levels by the filter's likelihood along the shortest runs."""
    declared, used, rows = observer.declared, list[int](), 0
    for n in sorted(range(len(observer.runs)), key=lambda n: len(observer.runs[n].t)):
        if used and rows + len(observer.runs[n].t) > LEVEL_ROWS:
            break
        used.append(n)
        rows += len(observer.runs[n].t)
    free = [("density", n) for n in range(len(declared.noises)) if declared.noises[n].density > 0.0]
    free += [("variance", n) for n in range(len(declared.outputs))]
    level = dict.fromkeys(free, 0.0)

    def cost() -> float:
        total = sum(observer.filter(n, _at(points[n], level)).value for n in used)
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
    return level
