"""What healthy runs leave of their measurements, and how much more other runs leave: the same for every vehicle.

The logarithm of a run's mean square scatters from run to run and from place to place. Of a few healthy runs its mean
and scatter are known by Student's distribution (docs/explanation/against-healthy.md, Likelihood).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm
from scipy.stats import t as student

from glider.tools.inference.hyperparameters import HEALTHY

SHIFTS = np.linspace(0.0, 4.0 * HEALTHY.unknown_scale, 121)
OF_SHIFTS = 2.0 * norm.pdf(SHIFTS, scale=HEALTHY.unknown_scale) * (SHIFTS[1] - SHIFTS[0])


@dataclass
class HealthyLevel:
    """The logarithm of a healthy run's mean square, in units that are 1 for what healthy runs leave on average."""

    count: int  # runs that it is known from
    level: float  # mean
    seen: float  # scatter from run to run, 1 sigma

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the logarithms' scatter."""
        return self.count - 1 + HEALTHY.prior_runs

    @property
    def scatter(self) -> float:
        """1 sigma of the logarithm from run to run, with what is usual as so many runs more."""
        squares = (self.count - 1) * self.seen**2 + HEALTHY.prior_runs * HEALTHY.run_scale**2
        return float(np.sqrt(squares / self.freedom))

    @property
    def independent(self) -> float:
        """Independent residuals of a run: of so many the mean square has this scatter (chi-squared)."""
        return 2.0 / self.scatter**2

    def scale(self, runs: int) -> float:
        """1 sigma of the logarithm of a mean square of some runs about `level`."""
        return float(np.sqrt(self.scatter**2 * (1.0 / self.count + 1.0 / runs) + HEALTHY.site_scale**2))

    def at_most(self, away: np.ndarray | float) -> np.ndarray:
        """Log density of what healthy runs leave; less than that is as likely. away: of the mean, in `scale`."""
        return student.logpdf(np.maximum(away, 0.0), self.freedom)

    def at(self, away: np.ndarray | float) -> np.ndarray:
        """The same where more was expected than healthy runs leave, and less speaks against it."""
        return student.logpdf(away, self.freedom)

    def unchanged(self, logarithm: float, scale: float) -> tuple[float, float]:
        """Log densities of a mean square: as healthy runs leave it, and more because of something unknown."""
        more = self.at((logarithm - self.level - SHIFTS) / scale)
        return float(self.at_most((logarithm - self.level) / scale)), float(logsumexp(more, b=OF_SHIFTS))
