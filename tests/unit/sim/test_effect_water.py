"""Effects of the water and of late commands on whole flights."""

import math

import numpy as np
import pytest

from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects.timing import delayed_commands, mean_input
from tests.support.effect_flights import flown, held, quiet, world

GRAVITY = 9.80665


def test_a_current_carries_along_and_a_shear_by_the_depths_passed():
    still, _ = flown(quiet({"depth_offset": {"offset": 1.0}}))
    carried, _ = flown(quiet({"current": {"north": 0.1, "east": -0.05}}))
    t = 0.1 * np.arange(len(still))
    assert carried[:, 0] - still[:, 0] == pytest.approx(0.1 * t, abs=1e-9)
    assert carried[:, 1] - still[:, 1] == pytest.approx(-0.05 * t, abs=1e-9)
    assert np.array_equal(carried[:, 2:], still[:, 2:])
    sheared, _ = flown(quiet({"current_shear": {"east": 0.02}}))
    way = np.concatenate([[0.0], np.cumsum(0.1 * 0.5 * (still[1:, 2] + still[:-1, 2]))])
    assert sheared[:, 1] - still[:, 1] == pytest.approx(0.02 * way, abs=1e-4)
    assert np.array_equal(sheared[:, 2:], still[:, 2:])


def test_an_environments_current_is_the_same_water_as_the_effects():
    labelled, _ = flown(quiet({"current": {"north": 0.2}, "current_shear": {"east": 0.01}, "drag": {"scale": 0.1}}))
    given, _ = flown(quiet({"drag": {"scale": 0.1}}, current_m_s=(0.2, 0.0), shear_1_s=(0.0, 0.01)))
    assert labelled[:, 2:16] == pytest.approx(given[:, 2:16], abs=1e-9)
    assert labelled[:, :2] == pytest.approx(given[:, :2], abs=5e-4)  # the environment's is held over a step


def test_waves_have_the_energy_of_their_amplitude_and_phases_of_the_seed():
    values = {"amplitude": 0.2, "period": 4.0, "direction": 0.5}
    first, again, other = (world({"waves": values}, seed).waves for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:, wl.WAVE_PHASE], other[:, wl.WAVE_PHASE])
    assert (first[:, wl.WAVE_AMPLITUDE] ** 2).sum() == pytest.approx(0.04)
    omega = first[:, wl.WAVE_OMEGA]
    assert (np.abs(omega / (2.0 * math.pi / 4.0) - 1.0) < 0.13).all()
    assert np.hypot(first[:, wl.WAVE_K_N], first[:, wl.WAVE_K_E]) == pytest.approx(omega**2 / GRAVITY)
    assert np.arctan2(first[:, wl.WAVE_K_E], first[:, wl.WAVE_K_N]) == pytest.approx(0.5)


def test_waves_beside_another_effect_move_the_vehicle_as_they_do_alone():
    """The step with effects holds the water over a step, the plain one does not: the same to a millimetre."""
    waves = {"waves": {"amplitude": 0.3, "period": 4.0, "direction": 0.5}}
    alone, _ = flown(quiet(waves, depth=3.0))
    beside, _ = flown(quiet({**waves, "gyro_scale": {"scale": 0.4}}, depth=3.0))
    calm, _ = flown(quiet(depth=3.0))
    assert np.abs(alone - calm)[:, :3].max() > 0.1
    assert beside[:, :3] == pytest.approx(alone[:, :3], abs=3e-3)


def test_waves_die_out_with_depth():
    def swing(depth):
        waves = {"waves": {"amplitude": 0.3, "period": 4.0, "direction": 0.0}}
        return np.ptp(flown(quiet(waves, depth=depth), 40.0, held(0.0, 0.0, 0.0))[0][:, 2])

    k = (2.0 * math.pi / 4.0) ** 2 / GRAVITY
    assert swing(6.0) / swing(2.0) == pytest.approx(math.exp(-4.0 * k), rel=0.2)


def test_turbulence_scales_the_disturbance_and_keeps_its_course():
    made = [
        world(effects, disturbance_linear=0.01, disturbance_angular=0.02)
        for effects in (None, {"turbulence": {"scale": 2.0}})
    ]
    for one in made:
        one.advance(3.05)
    assert made[1].acc == pytest.approx(3.0 * made[0].acc)
    assert made[0].acc.all()


@pytest.mark.parametrize("environment", [{"surface": True}, {"floor_m": 9.0}])
def test_surface_and_floor_hold_a_vehicle_with_effects_too(environment):
    ballast = -0.2 if "surface" in environment else 0.2
    states, _ = flown(quiet({"drag": {"scale": 0.2}}, **environment), 120.0, held(0.0, 0.0, ballast))
    plain, _ = flown(quiet(**environment), 120.0, held(0.0, 0.0, ballast))
    assert states[-1, 2] == pytest.approx(plain[-1, 2], abs=0.01)
    assert np.ptp(states[-50:, 2]) < 0.01


@pytest.mark.parametrize("delay", [0.01, 0.5, 0.7, 6.0])
def test_a_delay_shifts_commands_by_itself(delay):
    def stepped(moment):
        return lambda t: (0.5, -0.02, 0.1) if t >= moment - 1e-9 else (0.0, 0.0, 0.0)

    late = quiet({"command_delay": {"delay": delay}})
    punctual = quiet({"depth_offset": {"offset": 1.0}})
    for made, moment in ((late, 2.0), (punctual, 2.0 + delay)):
        for k in range(1000):
            made.advance(0.01 * k)
            made.cmd[:] = stepped(moment)(0.01 * k)
    assert np.array_equal(late.x, punctual.x)
    assert late.x[13] > 0.1


@pytest.mark.parametrize("delay", [0.03, 0.074, 0.1])
def test_a_worlds_late_commands_are_the_mean_that_a_recording_has_of_them(delay):
    dt, rng = 0.01, np.random.default_rng(3)
    t, commands = dt * np.arange(60), rng.standard_normal((60, 3))
    queue, late = np.zeros((math.ceil(delay / dt) + 2, 3)), np.zeros(3)
    for step in range(60):
        delayed_commands(queue, commands[step], step, delay, dt, late)
        since = t[step] - delay
        if step > 20:
            rows = [mean_input(t, commands, column, step, 0, since, since + dt) for column in range(3)]
            assert late == pytest.approx(rows, abs=1e-9)


def test_a_delay_between_two_steps_lies_between_them():
    def servo(delay):
        made = quiet({"command_delay": {"delay": delay}})
        made.advance(1.0)
        made.cmd[:] = 0.005, 0.0, 0.0  # near: the servo follows linearly
        made.advance(1.3)
        return made.x[13]

    assert servo(0.105) == pytest.approx(0.5 * (servo(0.10) + servo(0.11)), rel=1e-9)
    assert servo(0.10) > servo(0.11)
