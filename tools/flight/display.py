"""What a person reads while a flight is under way: a line of status once a second, and messages above it.

All of it is read from the autopilot's memory between two ticks. A write never waits: where terminal or pipe take no
more, the line is lost.
"""

import contextlib
import math
import os
import select

from glider.firmware.core.layouts import control_layout as ctl
from glider.tools.flight.compose import Flight

PLAIN_S = 10.0  # between two lines where there is no terminal
STDERR = 2
CLEAR = "\r\x1b[K"


def write_at_once(text: str) -> bool:
    """Write to standard error unless that would wait; also from a signal handler. Whether all of it was written."""
    data = text.encode("utf-8", "replace")
    with contextlib.suppress(OSError, ValueError):
        _, ready, _ = select.select([], [STDERR], [], 0.0)
        return bool(ready) and os.write(STDERR, data) == len(data)
    return False


class Display:
    """The status of one flight: renewed once a second on a terminal, elsewhere a line every PLAIN_S and at a new leg.

    `muted`: only what `tell` is given, of a flight faster than the clock on the wall, which has a bar.
    """

    def __init__(self, flight: Flight, *, muted: bool = False):
        self._flight, self._muted = flight, muted
        self._terminal = os.isatty(STDERR)
        self._began = math.nan
        self._shown: tuple[float, str, int] = (-math.inf, "", -1)  # when, mode and leg of the last plain line

    def second(self, t: float) -> None:
        """Once a second, between two ticks, at time t (s)."""
        second = math.floor(t)  # by the clock's own seconds: a late tick gives no second twice
        if math.isnan(self._began):
            self._began = second
        if self._muted:
            return
        if self._terminal:
            with contextlib.suppress(OSError):  # the terminal has gone meanwhile
                width = os.get_terminal_size(STDERR).columns - 1  # a full line would wrap
                write_at_once(CLEAR + status(self._flight, t, second - self._began)[: width or None])
            return
        autopilot, (when, mode, leg) = self._flight.autopilot, self._shown
        now = (second, autopilot.mode, int(autopilot.ap[ctl.LEG]))
        if second - when >= PLAIN_S or now[1:] != (mode, leg):
            write_at_once(status(self._flight, t, second - self._began) + "\n")
            self._shown = now

    def tell(self, text: str) -> None:
        """A whole line at once, the status below it."""
        write_at_once(f"{CLEAR if self._terminal else ''}{text}\n")

    def end(self) -> None:
        """Take the status away."""
        if self._terminal and not self._muted:
            write_at_once(CLEAR)


def status(flight: Flight, t: float, seconds: float) -> str:
    """The flight at time t (s of the board's clock), `seconds` after its start: time, depth, pitch, leg, what is left
    of the leg."""
    autopilot, legs = flight.autopilot, len(flight.mission.leg)
    est = autopilot.est
    where = "depth    -, pitch    -"
    if est[ctl.EST_STARTED]:
        where = f"depth {est[ctl.EST_DEPTH]:5.2f} m, pitch {math.degrees(est[ctl.EST_PITCH]):+5.1f} deg"
    leg = f"leg {int(autopilot.ap[ctl.LEG]) + 1} of {legs}: " if autopilot.mode == "flying" else ""
    return f"{seconds:5.0f} s  {where}  {leg}{left_of_leg(flight, t)}"


def left_of_leg(flight: Flight, t: float) -> str:
    """What is left of the leg under way, in its own measure; or what the vehicle does instead."""
    autopilot = flight.autopilot
    ap, est, mode = autopilot.ap, autopilot.est, autopilot.mode
    if mode == "waiting":
        return "waiting for the sensors"
    if mode != "flying":
        return "mission completed, surfacing" if mode == "completed" else f"given up ({autopilot.reason}), surfacing"
    leg = autopilot.legs[int(ap[ctl.LEG])]
    passed = t - ap[ctl.LEG_START]
    if math.isfinite(leg[ctl.LEG_DURATION]):
        return f"{_to_go(leg[ctl.LEG_DURATION] - passed)} s left"
    limit = f", limit in {_to_go(leg[ctl.LEG_TIME_LIMIT] - passed)} s"
    if ap[ctl.REACHED] >= 0.0:
        return f"{_to_go(leg[ctl.LEG_HOLD] - (t - ap[ctl.REACHED]))} s of hold left{limit}"
    if math.isfinite(leg[ctl.LEG_TURNED]):
        return f"{_to_go(math.degrees(leg[ctl.LEG_TURNED] - abs(ap[ctl.TURNED])))} deg of turn left{limit}"
    target = leg[ctl.LEG_DEPTH]
    return f"{abs(target - est[ctl.EST_DEPTH]):.1f} m left to {target:g} m{limit}"


def _to_go(value: float) -> str:
    return f"{max(value, 0.0):.0f}"
