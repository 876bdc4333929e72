"""90 % intervals, two-sided."""

import math

NINETY = 1.645  # sigma on either side of a normal mean
_Z = 1.6448536269514722  # the same with all its digits


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Interval of a share, by Wilson's score: inside 0 to 1 and right for shares of 0 and 1 too; of nothing, 0 to 1."""
    if n == 0:
        return 0.0, 1.0
    share, z2 = successes / n, _Z * _Z
    middle = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = _Z / (1 + z2 / n) * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)
