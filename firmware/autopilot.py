"""The autopilot: tick(frame, t) -> commands, pure but for its own memory. The readable face of core/autopilot."""

import math

import numpy as np

from glider.firmware.core.control import autopilot as core
from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.firmware.core.estimation.sensing import longest_age
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts.estimator_layout import COMMANDED
from glider.firmware.core.vehicle.seawater import STANDARD_PRESSURE
from glider.firmware.faults import FAULTS
from glider.firmware.guidance.mission import Mission
from glider.firmware.model.estimator_settings import estimator_settings, first_spread, parameter_sigma
from glider.firmware.model.gains import Control
from glider.firmware.model.vehicle import Vehicle
from glider.hal.ports import empty_frame
from glider.hal.strict import ConfigError

MODES = {ctl.WAITING: "waiting", ctl.FLYING: "flying", ctl.COMPLETED: "completed", ctl.ABORTED: "aborted"}
REASONS = {
    ctl.REASON_NONE: "", ctl.REASON_LEG_TIME: "leg over its time limit",
    ctl.REASON_MISSION_TIME: "mission over its time limit", ctl.REASON_IMU: "no attitude",
    ctl.REASON_BEACON: "no depth", ctl.REASON_TOO_DEEP: "deeper than the site",
    ctl.REASON_OPERATOR: "asked to by the operator",
}  # fmt: skip
ESTIMATORS = {"measured": ctl.MEASURED, "filter": ctl.FILTERED, "given": ctl.GIVEN}


def configuration(
    vehicle: Vehicle,
    mission: Mission,
    *,
    dt: float,
    periods: dict[str, float],
    surface_pressure: float = STANDARD_PRESSURE,
    abort_age: float = 1.0,
) -> np.ndarray:
    """The configuration vector C, shape (ctl.N_C,).

    Gains come from the mission, else the vehicle, else the defaults. `periods` are the sensors' sample periods in s
    (imu, beacon, wires); core/estimation/sensing, longest_age.
    """
    control = mission.control or vehicle.control or Control()
    C = np.zeros(ctl.N_C)
    C[ctl.DT] = dt
    for name, gains in (("PITCH", control.pitch), ("DEPTH", control.depth)):
        C[getattr(ctl, f"{name}_KP")] = gains.kp
        C[getattr(ctl, f"{name}_KI")] = gains.ki
        C[getattr(ctl, f"{name}_KD")] = gains.kd
    C[ctl.ROLL_KP], C[ctl.ROLL_KD] = control.roll.kp, control.roll.kd
    C[ctl.HEADING_KP], C[ctl.HEADING_KD] = control.heading.kp, control.heading.kd
    for name, reference in (
        ("PITCH", control.pitch.reference),
        ("DEPTH", control.depth.reference),
        ("ROLL", control.roll.reference),
    ):
        wn = reference.wn
        if wn * dt > 0.5:
            raise ConfigError(mission.name, f"{wn} rad/s is too fast for a step of {dt} s", key="reference.wn")
        C[getattr(ctl, f"{name}_WN")] = wn
        C[getattr(ctl, f"{name}_ZETA")] = reference.zeta
    C[ctl.DEPTH_FILTER_WN] = control.depth.rate_bandwidth
    C[ctl.MAX_AGE_IMU] = longest_age(periods["imu"], dt)
    C[ctl.MAX_AGE_BEACON] = longest_age(periods["beacon"], dt)
    C[ctl.MAX_AGE_WIRE] = longest_age(periods["wires"], dt)
    C[ctl.ABORT_AGE] = abort_age
    C[ctl.SALINITY] = mission.site.salinity
    C[ctl.SURFACE_PRESSURE] = surface_pressure
    C[ctl.SITE_DEPTH] = mission.site.depth_m
    C[ctl.MISSION_TIME_LIMIT] = mission.time_limit_s
    C[ctl.ESTIMATOR] = ESTIMATORS[control.estimator]
    C[ctl.CONTROLLER] = CONTROLLERS[control.controller].number
    law = control.law_flown
    C[ctl.FORM] = ctl.PAPER if law.form == "paper" else ctl.EXACT
    C[ctl.OBSERVER_SHARE] = law.observer_share
    for name, table in (("PITCH", law.pitch), ("DEPTH", law.depth)):
        for gain in ("k1", "k2", "k3", "eps"):
            C[getattr(ctl, f"{name}_{gain.upper()}")] = getattr(table, gain)
    for gain in ("roughness", "pitch", "depth"):
        for edge in ("on", "off"):
            C[getattr(ctl, f"HYBRID_{gain}_{edge}".upper())] = getattr(control.hybrid, f"{gain}_{edge}")
    C[ctl.HYBRID_DWELL] = control.hybrid.dwell_s
    return C


def filter_memory(vehicle: Vehicle) -> np.ndarray:
    """The Kalman filter's vector nav, shape (ctl.N_NAV,), with what the vehicle file says of sensors and errors."""
    P = vehicle.vector()
    nav = np.zeros(ctl.N_NAV)
    for start, values in (
        (ctl.NAV_SETTINGS, estimator_settings(vehicle.sensors, vehicle.disturbance)),
        (ctl.NAV_SIGMA, parameter_sigma(P, vehicle.uncertainty)),
        (ctl.NAV_SPREAD, first_spread(P, COMMANDED, (True, True, True))),
    ):
        nav[start : start + len(values)] = values
    return nav


def reason_text(code: float, leg: int, legs: np.ndarray) -> str:
    """Describe why a dive was given up (a REASON_ code) in which leg (from 0) of `legs`; empty if it was not."""
    if code > ctl.REASON_FAULT:
        row = int(code - ctl.REASON_FAULT)
        return f"fault {row}: {FAULTS[row]}"
    if code == ctl.REASON_LEG_TIME:
        target, turn = legs[leg, ctl.LEG_DEPTH], legs[leg, ctl.LEG_TURNED]
        missed = f"not at {target:g} m" if math.isfinite(target) else f"not turned by {math.degrees(turn):g} deg"
        return f"leg {leg + 1}: {missed} within {legs[leg, ctl.LEG_TIME_LIMIT]:g} s"
    return REASONS[code]


class Autopilot:
    """Flies one mission with one vehicle. All memory is allocated here; `tick` only writes into it."""

    def __init__(self, vehicle: Vehicle, mission: Mission, C: np.ndarray, source: str = "mission"):
        self.P = vehicle.vector()
        self.C = C
        self.legs = mission.matrix(vehicle, source)
        self.frame = empty_frame()
        self.est = np.zeros(ctl.N_EST)
        self.ap = np.zeros(ctl.N_AP)
        self.nav = filter_memory(vehicle)
        self.commands = np.zeros(3)
        core.reset(self.est, self.ap, self.nav)

    def tick(self, t: float) -> np.ndarray:
        """Take self.frame at time t (s) and return the commands: servo rad, slider m, ballast kg (its own array)."""
        core.tick(self.P, self.C, self.legs, self.frame, self.est, self.ap, self.nav, self.commands, t)
        return self.commands

    @property
    def mode(self) -> str:
        return MODES[float(self.ap[ctl.MODE])]

    @property
    def reason(self) -> str:
        """Why the dive was given up, with the leg; empty if it was not."""
        return reason_text(float(self.ap[ctl.REASON]), int(self.ap[ctl.LEG]), self.legs)

    @property
    def finished(self) -> bool:
        """True once the mission is completed or given up."""
        return bool(self.ap[ctl.MODE] >= ctl.COMPLETED)

    def give_up(self) -> None:
        """Request an abort for the operator; the next tick takes it: ballast out, nose up, to the surface.

        One number is written, so that a signal handler may call this at any time between two kernels.
        """
        self.ap[ctl.STOP_REQUESTED] = 1.0

    def rms_errors(self) -> dict[str, float | None]:
        """Rms of estimate less reference while flying: depth_m, pitch_rad, roll_rad; None where not controlled."""
        depth, attitude = self.ap[ctl.COUNT_DEPTH], self.ap[ctl.COUNT_ATTITUDE]

        def rms(total: float, count: float) -> float | None:
            return math.sqrt(total / count) if count else None

        return {
            "depth_m": rms(self.ap[ctl.SUM_DEPTH], depth),
            "pitch_rad": rms(self.ap[ctl.SUM_PITCH], attitude),
            "roll_rad": rms(self.ap[ctl.SUM_ROLL], attitude),
        }
