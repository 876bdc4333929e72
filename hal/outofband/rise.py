"""Does it rise? Row 18 of the fault table, judged by the out-of-band process for itself.

See docs/explanation/supervisor.md.

A pure rule: time and depth are arguments. It shares nothing with the supervisor's but the numbers in the plan.
"""

from enum import IntEnum


class AscentStage(IntEnum):
    """How the way up goes."""

    BLIND = 0  # no depth: the pump at its light end is all that can be brought about
    RISING = 1  # or not yet due
    SURFACED = 2
    AGAIN = 3  # no rise within the time: pump again, as far as it goes
    HARDWARE = 4  # nor after that: the hardware watchdog is no longer fed; for good


class Rise:
    """`look` at every round of the way up."""

    def __init__(self, patience_s: float, step_m: float, surface_m: float):
        """As the vehicle file's no_ascent_s, ascent_step_m and surface_m."""
        self.stage = AscentStage.BLIND
        self._patience, self._step, self._surface = patience_s, step_m, surface_m
        self._mark = 0.0  # the depth from which it has to rise
        self._since = self._heard = -1e9

    def look(self, t: float, depth: float | None) -> AscentStage:
        """The stage at t (s), with the depth (m) where there is one."""
        if depth is None:
            if t - self._heard > self._patience and self.stage != AscentStage.HARDWARE:
                self.stage = AscentStage.BLIND
            return self.stage
        if self.stage == AscentStage.BLIND or t - self._heard > self._patience:  # seen for the first time, or again
            self._mark, self._since = depth, t
            if self.stage == AscentStage.BLIND:
                self.stage = AscentStage.RISING
        self._heard = t
        if depth < self._surface or depth < self._mark - self._step:
            self._mark, self._since = depth, t
            self._turn(AscentStage.SURFACED if depth < self._surface else AscentStage.RISING)
            return self.stage
        self._mark = max(self._mark, depth)  # it may sink on until the ballast is out
        if t - self._since >= self._patience:
            self._since = t
            self._turn(AscentStage.HARDWARE if self.stage == AscentStage.AGAIN else AscentStage.AGAIN)
        elif self.stage == AscentStage.SURFACED and depth > self._surface + self._step:
            self._turn(AscentStage.RISING)  # it was: a wave, or it sinks again
        return self.stage

    def _turn(self, stage: AscentStage) -> None:
        """HARDWARE is not taken back: what fed a watchdog again after it would make the outcome a matter of luck."""
        if self.stage != AscentStage.HARDWARE:
            self.stage = stage
