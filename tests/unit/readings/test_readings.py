"""Readings against each other: each fault alone is found with its size, and right instruments are not accused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.data.runs.run import Run
from glider.tools.readings.check import check

pytestmark = pytest.mark.computes(seconds=15)

PERIOD = 0.1
RATES = ("p_rad_s", "q_rad_s", "r_rad_s")


def swaying(t: np.ndarray, rng: np.random.Generator, size: float, slowest: float) -> np.ndarray:
    """A smooth random course: five sines of periods from 3 s to `slowest`."""
    periods = np.geomspace(3.0, slowest, 5)
    phases, share = rng.uniform(0.0, 2.0 * np.pi, 5), rng.uniform(0.5, 1.0, 5) * periods / slowest
    return size * sum(a * np.sin(2.0 * np.pi * t / p + f) for a, p, f in zip(share, periods, phases, strict=True))


def flight(n: int, seconds: float = 100.0, mocap: bool = True) -> Run:
    """A run of a body that turns and sinks as it likes: Euler angles chosen, body rates by equation (5) inverted."""
    rng = np.random.default_rng(100 + n)
    t = np.arange(0.0, seconds, PERIOD)
    fine = np.arange(0.0, seconds, 0.01)

    def course(values):
        return np.interp(t, fine, values), np.interp(t, fine, np.gradient(values, fine))

    phi, phi_dot = course(swaying(fine, rng, 0.25, 12.0))
    theta, theta_dot = course(swaying(fine, rng, 0.45, 25.0))
    psi, psi_dot = course(0.05 * fine + swaying(fine, rng, 0.7, 40.0))
    depth, _ = course(4.0 + swaying(fine, rng, 2.0, 50.0))
    rates = (
        phi_dot - psi_dot * np.sin(theta),
        theta_dot * np.cos(phi) + psi_dot * np.cos(theta) * np.sin(phi),
        -theta_dot * np.sin(phi) + psi_dot * np.cos(theta) * np.cos(phi),
    )
    noise = rng.standard_normal
    columns = {"t_s": t}
    for name, values in zip(("roll_rad", "pitch_rad", "yaw_rad"), (phi, theta, psi), strict=True):
        columns[name] = values + 0.0026 * noise(len(t)) + 0.002 * rng.standard_normal()
    for name, values in zip(RATES, rates, strict=True):
        columns[name] = values + 0.003 * noise(len(t)) + 0.0003 * rng.standard_normal()
    columns["depth_m"] = depth + 0.004 * noise(len(t)) + 0.004 * rng.standard_normal()
    if mocap:
        place = np.cumsum(0.3 * np.cos(psi)) * PERIOD, np.cumsum(0.3 * np.sin(psi)) * PERIOD, depth
        for name, values in zip("xyz", place, strict=True):
            columns[f"mocap_{name}_m"] = values + 0.002 * noise(len(t))
        for name, values in zip(("roll", "pitch", "yaw"), (phi, theta, psi), strict=True):
            columns[f"mocap_{name}_rad"] = values + 0.0017 * noise(len(t))
    return Run(f"run{n:02d}", None, columns)


FLIGHTS = [flight(n) for n in range(3)]
ONBOARD = [replace(run, columns={k: v for k, v in run.columns.items() if "mocap" not in k}) for run in FLIGHTS]


def changed(change, runs=None) -> list[Run]:
    """The flights with something done to their columns."""
    out = []
    for run in runs or FLIGHTS:
        columns = {name: values.copy() for name, values in run.columns.items()}
        change(columns)
        out.append(replace(run, columns=columns))
    return out


def late(values: np.ndarray, delay: float) -> np.ndarray:
    t = PERIOD * np.arange(len(values))
    return np.interp(t - delay, t, values)


def found(runs: list[Run]) -> dict:
    return {(one.channel, one.finding): one for one in check(runs).findings}


@pytest.mark.parametrize("runs", [FLIGHTS, ONBOARD], ids=["motion capture", "onboard"])
def test_instruments_that_are_fine_are_not_accused(runs):
    assert check(runs).findings == []


def test_a_gyro_scale_is_measured_and_mended():
    def scaled(columns):
        for name in RATES:
            columns[name] *= 0.8

    runs = changed(scaled)
    readings = check(runs)
    scales = [one for one in readings.findings if one.finding == "scale"]
    assert [one.label for one in scales] == 3 * ["gyro_scale"]
    for one in scales:
        assert one.ci90[0] - 0.002 < -0.2 < one.ci90[1] + 0.002
    assert check(readings.runs).findings == []


def test_a_gyro_bias_is_measured_and_mended():
    def biased(columns):
        columns["q_rad_s"] += 0.01

    readings = check(changed(biased))
    (one,) = readings.findings
    assert (one.channel, one.finding, one.label) == ("q_rad_s", "offset", "gyro_bias")
    assert one.size == pytest.approx(0.01, abs=0.001)
    assert check(readings.runs).findings == []


def test_a_scale_of_the_attitude_is_not_put_down_to_the_gyro():
    def change(columns):
        columns["pitch_rad"] *= 1.15

    answer = found(changed(change))
    assert answer[("pitch_rad", "scale")].label == "attitude_scale"
    assert answer[("pitch_rad", "scale")].size == pytest.approx(0.15, abs=0.01)
    assert not any(channel in RATES for channel, _ in answer)
    # Without motion capture nobody can say which of the two it is: the rate is held against the attitude.
    assert ("q_rad_s", "scale") in found(changed(change, ONBOARD))


def test_swapped_axes_are_named():
    def swapped(columns):
        columns["p_rad_s"], columns["r_rad_s"] = columns["r_rad_s"], columns["p_rad_s"]

    said = found(changed(swapped, ONBOARD))
    assert {name for name, kind in said if kind == "axes"} == {"p_rad_s", "r_rad_s"}
    assert check(check(changed(swapped, ONBOARD)).runs).findings == []


def test_a_flipped_sign_is_named_and_mended():
    def flipped(columns):
        columns["r_rad_s"] *= -1.0

    readings = check(changed(flipped, ONBOARD))
    (one,) = readings.findings
    assert (one.channel, one.finding) == ("r_rad_s", "sign")
    assert one.size == pytest.approx(-1.0, abs=0.02)
    assert check(readings.runs).findings == []


def test_degrees_for_radians_are_named():
    def degrees(columns):
        columns["q_rad_s"] = np.degrees(columns["q_rad_s"])

    said = found(changed(degrees, ONBOARD))
    assert said["q_rad_s", "units"].size == pytest.approx(180.0 / math.pi, rel=0.02)


def test_euler_rates_for_body_rates_are_named():
    def euler(columns):
        for name, angle in zip(RATES, ("roll_rad", "pitch_rad", "yaw_rad"), strict=True):
            smooth = np.convolve(columns[angle], np.ones(3) / 3.0, "same")
            columns[name] = np.gradient(smooth, columns["t_s"])

    kinds = [(one.finding, one.text) for one in check(changed(euler, ONBOARD)).findings]
    assert any(kind == "axes" and "Euler" in text for kind, text in kinds)


@pytest.mark.parametrize("hold", [0.3, 0.5])
def test_a_held_attitude_is_named(hold):
    def held(columns):
        rows = round(hold / PERIOD)
        for name in ("roll_rad", "pitch_rad", "yaw_rad"):
            columns[name] = columns[name][np.arange(len(columns[name])) // rows * rows]

    said = found(changed(held, ONBOARD))
    assert said["pitch_rad", "held"].size == pytest.approx(hold - PERIOD, abs=0.01)


@pytest.mark.parametrize("delay", [0.15, 0.6])
def test_a_late_attitude_is_attitude_lag(delay):
    def lagging(columns):
        for name in ("roll_rad", "pitch_rad", "yaw_rad"):
            columns[name] = late(columns[name], delay)

    said = found(changed(lagging))
    assert said["attitude", "delay"].label == "attitude_lag"
    assert said["attitude", "delay"].size == pytest.approx(delay, abs=0.02)
    assert ("mocap", "delay") not in said


def test_late_motion_capture_is_mocap_delay_and_nothing_else():
    def slow(columns):
        for name in columns:
            if name.startswith("mocap"):
                columns[name] = late(columns[name], 0.5)

    (one,) = check(changed(slow)).findings
    assert (one.label, one.finding) == ("mocap_delay", "delay")
    assert one.size == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("label", "size", "change"),
    [
        ("depth_offset", 0.1, lambda c: c["depth_m"] + 0.1),
        ("depth_scale", 0.05, lambda c: 1.05 * c["depth_m"]),
        ("depth_lag", 0.5, lambda c: late(c["depth_m"], 0.5)),
        ("pressure_lever", 0.2, lambda c: c["depth_m"] - 0.2 * np.sin(c["mocap_pitch_rad"])),
    ],
)
def test_the_depths_faults_beside_motion_capture(label, size, change):
    def wrong(columns):
        columns["depth_m"] = change(columns)

    readings = check(changed(wrong))
    (one,) = readings.findings
    assert one.label == label
    assert one.size == pytest.approx(size, abs=0.02)
    assert check(readings.runs).findings == []


@pytest.mark.parametrize(("angle", "label"), [("pitch_rad", "imu_pitch_bias"), ("roll_rad", "imu_roll_bias")])
def test_the_imus_bias_beside_motion_capture(angle, label):
    def tilted(columns):
        columns[angle] += 0.05

    (one,) = check(changed(tilted)).findings
    assert one.label == label
    assert one.size == pytest.approx(0.05, abs=0.005)


def test_minutes_at_the_surface_are_left_out_and_the_gauge_that_feels_the_tank_is_found():
    rng = np.random.default_rng(5)

    def with_surface(run: Run, tank: float) -> Run:
        t, columns = run.t, dict(run.columns)
        floats = t < 40.0
        ballast = np.where(floats, tank + 0.06 * (t > 20.0), 0.0)
        level = 0.05 + 0.01 * np.sin(2.0 * np.pi * t / 3.0) + 0.004 * rng.standard_normal(len(t))
        columns["ballast_kg"] = ballast + 0.0003 * rng.standard_normal(len(t))
        columns["depth_m"] = np.where(floats, level, columns["depth_m"]) - 1.0 * ballast
        return replace(run, columns=columns)

    readings = check([with_surface(run, tank) for run, tank in zip(ONBOARD, (-0.1, 0.0, -0.05), strict=True)])
    said = {(one.finding, one.against): one for one in readings.findings}
    assert said["goes_with", "ballast_kg"].size == pytest.approx(-1.0, abs=0.1)
    assert sum(one.finding == "not_flying" for one in readings.findings) == 3


def test_nothing_to_compare_is_said():
    run = replace(FLIGHTS[0], columns={name: FLIGHTS[0].columns[name] for name in ("t_s", "depth_m")})
    with pytest.raises(InputError, match="depth_m only"):
        check([run])


def test_samples_that_never_move_are_said():
    def dead(columns):
        for name in ("roll_rad", "pitch_rad", "yaw_rad", *RATES, "depth_m"):
            columns[name][:] = columns[name][0]

    findings = check(changed(dead, ONBOARD)).findings
    assert {one.channel for one in findings if "not move" in one.text} >= {"pitch_rad", "q_rad_s"}
