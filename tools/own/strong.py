"""Labels at sizes at which they alone explain most of some runs: where a strong change leads, no parabola goes."""

from collections.abc import Sequence

import numpy as np

from glider.tools.own.decision import Healthy
from glider.tools.own.effects import FORM, NOISE, moved
from glider.tools.own.hierarchy import LEAST_REACH
from glider.tools.own.observer import Filtered, Observer

STRONG = 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0  # tolerances
STRONG_LEFT = 1.5  # times what healthy runs leave, from which strong labels are looked for
STRONG_ROWS, STRONG_WORSE = 1_500, 2  # rows looked at; larger sizes that are each worse, behind which none is tried


def strong_sizes(
    observer: Observer, healthy: Healthy, reach: np.ndarray, among: Sequence[int]
) -> list[tuple[int, float]]:
    """Labels, and the size in spreads at which each leaves least of some runs by itself, best first.

    reach (k,): tolerances a spread; among: runs, of which the shortest are flown. Every label is flown at larger and
    larger sizes, in both directions, as long as they help.
    """
    effects, horizon, filters, rows = healthy.effects, observer.horizon, dict[int, Filtered](), 0
    for n in sorted(among, key=lambda n: len(observer.runs[n].t)):
        if filters and rows + len(observer.runs[n].t) > STRONG_ROWS:
            break
        filters[n] = observer.filter(n, observer.point)
        rows += len(observer.runs[n].t)

    def squares(places: Sequence[int], sizes: Sequence[float]) -> np.ndarray:
        points = [moved(observer.declared, observer.point, [effects[k]], np.array([size]))
                  for k, size in zip(places, sizes, strict=True)]  # fmt: skip
        return np.sum([healthy.errors.misfit(n, observer.residuals(n, points, by, horizon))
                       for n, by in filters.items()], axis=0)  # fmt: skip

    begun, found = float(squares([0], [0.0])[0]), dict[int, tuple[float, float]]()
    ways = {(k, sign): (0, begun) for k, one in enumerate(effects) for sign in (1.0, -1.0)
            if reach[k] > LEAST_REACH and one.family not in (FORM, NOISE) and one.odds > 0.0}  # fmt: skip
    for strong in STRONG:
        sizes = {way: way[1] * strong / reach[way[0]] for way in ways}
        sizes = {way: size for way, size in sizes.items() if effects[way[0]].low <= size <= effects[way[0]].high}
        left = squares([k for k, _ in sizes], list(sizes.values())).tolist() if sizes else []
        on = dict[tuple[int, float], tuple[int, float]]()
        for (way, size), here in zip(sizes.items(), left, strict=True):
            worse, before = ways[way]
            if way[0] not in found or here < found[way[0]][0]:
                found[way[0]] = here, size
            worse = 0 if here <= before else worse + 1
            if worse < STRONG_WORSE:
                on[way] = worse, here
        ways = on
    return [(k, size) for k, (_, size) in sorted(found.items(), key=lambda one: one[1][0])]
