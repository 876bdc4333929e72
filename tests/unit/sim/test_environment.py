"""The environment: water that moves, a surface, a floor, a disturbance; each against its closed form."""

import math

import numpy as np
import pytest

from glider.firmware.core.maths.rotations import euler_from_quaternion
from glider.firmware.core.vehicle.layout import N_X
from glider.sim_backend.core.environment import water_velocity
from glider.sim_backend.core.open_loop import fly_open_loop, fly_open_loop_many
from glider.sim_backend.core.plant import hold_disturbance, plant_step
from glider.sim_backend.world import Environment, SampledSensor, SampledSensors, Start, Wave, build_world
from glider.tools.data.sources import load_vehicle

VEHICLE = load_vehicle("roughie")
CALM = dict(disturbance_linear=0.0, disturbance_angular=0.0)
GRAVITY = 9.80665


def world(seed=0, start=None, effects=None, **environment):
    return build_world(
        VEHICLE, Environment(**{**CALM, **environment}), SampledSensors(), start or Start(depth_m=5.0), seed, effects
    )


def fly(w, commands=(0.0, 0.0, 0.0), seconds=20.0):
    out = np.zeros((int(10 * seconds), N_X))
    held = np.tile(commands, (len(out), 1)).astype(float)
    fly_open_loop(w.P, w.E, w.F, w.waves, w.seed, w.x, held, 0.01, 10, out)
    return out


def test_current_and_shear():
    w = world(current_m_s=(0.2, -0.1), shear_1_s=(0.01, 0.02))
    assert water_velocity(w.E, w.waves, 0.0, 0.0, 5.0, 0.0) == pytest.approx((0.25, 0.0, 0.0))


def test_wave_orbits_shrink_with_depth_and_turn_with_their_period():
    wave = Wave(height_m=0.4, period_s=4.0, direction_deg=30.0)
    w = world(wave=[wave])
    omega = 2 * math.pi / 4.0
    k = omega**2 / GRAVITY
    times = np.linspace(0.0, 4.0, 41)
    for depth in (0.0, 2.0, 5.0):
        v = np.array([water_velocity(w.E, w.waves, 0.0, 0.0, depth, t) for t in times])
        speed = np.linalg.norm(v, axis=1)
        assert speed == pytest.approx(0.2 * omega * math.exp(-k * depth))  # circular orbits in deep water
        assert v[0] == pytest.approx(v[-1])
        assert v[:, 1] == pytest.approx(v[:, 0] * math.tan(math.radians(30.0)))


def test_wave_velocity_is_a_potential_flow():
    """Divergence and curl in the vertical plane vanish: the field is one that water can have."""
    w = world(wave=[Wave(height_m=0.5, period_s=5.0)])
    h = 1e-5

    def v(x, z):
        return np.array(water_velocity(w.E, w.waves, x, 0.0, z, 1.3))

    dx = (v(3.0 + h, 2.0) - v(3.0 - h, 2.0)) / (2 * h)
    dz = (v(3.0, 2.0 + h) - v(3.0, 2.0 - h)) / (2 * h)
    assert dx[0] + dz[2] == pytest.approx(0.0, abs=1e-9)
    assert dx[2] - dz[0] == pytest.approx(0.0, abs=1e-9)


def test_neutral_vehicle_rides_a_long_wave():
    """A neutral hull follows accelerating water: carried round the orbit of a long wave, without being left behind."""
    w = world(wave=[Wave(height_m=1.0, period_s=10.0)])
    states = fly(w, seconds=40.0)
    k = (2 * math.pi / 10.0) ** 2 / GRAVITY
    orbit = 0.5 * math.exp(-k * 5.0)
    assert np.ptp(states[:, 2]) == pytest.approx(2 * orbit, rel=0.15)


def test_light_vehicle_comes_to_rest_at_the_surface():
    w = world(start=Start(depth_m=1.0))
    states = fly(w, (0.0, 0.0, -0.2), seconds=120.0)
    assert -0.05 < states[-1, 2] <= 0.01
    assert np.ptp(states[-100:, 2]) < 0.01


def test_heavy_vehicle_comes_to_rest_on_the_floor():
    w = world(floor_m=6.0)
    states = fly(w, (0.0, 0.0, 0.2), seconds=120.0)
    assert states[:, 2].max() < 6.1
    assert 6.0 <= states[-1, 2] < 6.01


def test_disturbance_is_held_and_has_its_strength():
    w = world(disturbance_linear=0.02, disturbance_angular=0.05)
    held = []
    for step in range(40_000):
        hold_disturbance(w.E, w.seed, w.counters, 0.01 * step, w.acc)
        held.append(w.acc.copy())
    held = np.array(held).reshape(-1, 10, 6)
    assert (held == held[:, :1]).all()
    strength = held[:, 0].std(axis=0)
    assert strength == pytest.approx([0.02] * 3 + [0.05] * 3, rel=4 / math.sqrt(2 * len(held)))


def test_the_disturbance_enters_after_the_mass_matrix():
    """The same strength on every axis, whatever the added mass: nu_dot itself is shifted."""
    w = world()
    muted, moved = w.x.copy(), w.x.copy()
    acc = np.array([0.01, -0.02, 0.03, 0.01, 0.02, -0.01])
    dt = 1e-5
    plant_step(w.P, w.E, w.waves, muted, w.cmd, 0.0, dt, np.zeros(6), w.work)
    plant_step(w.P, w.E, w.waves, moved, w.cmd, 0.0, dt, acc, w.work)
    assert (moved - muted)[7:13] / dt == pytest.approx(acc, rel=1e-3)


def test_many_flights_are_the_flights_one_by_one_bit_for_bit():
    worlds = [world(seed=s, disturbance_linear=0.01, disturbance_angular=0.01) for s in range(7)]
    commands = np.tile([0.3, -0.02, 0.1], (50, 1))
    alone = []
    for w in worlds:
        out = np.zeros((50, N_X))
        fly_open_loop(w.P, w.E, w.F, w.waves, w.seed, w.x.copy(), commands, 0.01, 10, out)
        alone.append(out)
    together = np.zeros((7, 50, N_X))
    fly_open_loop_many(
        np.array([w.P for w in worlds]), np.array([w.E for w in worlds]), np.array([w.F for w in worlds]),
        worlds[0].waves, np.array([w.seed for w in worlds]), np.array([w.x for w in worlds]),
        np.array([commands] * 7), 0.01, 10, together,
    )  # fmt: skip
    assert np.array_equal(together, np.array(alone))
    assert not np.array_equal(alone[0], alone[1])


def test_sensors_keep_their_rate_and_delay():
    sensors = SampledSensors(
        imu=SampledSensor(rate_hz=50.0, delay_s=0.03), beacon=SampledSensor(rate_hz=10.0, delay_s=0.05)
    )
    w = build_world(VEHICLE, Environment(**CALM), sensors, Start(depth_m=5.0), 0)
    seen = {0: [], 8: []}
    for tick in range(100):
        t = w.advance(0.01 * tick)
        for start, times in seen.items():
            if w.frame[start + 1] == 1.0:
                assert t - w.frame[start] >= {0: 0.03, 8: 0.05}[start] - 1e-9
                if not times or w.frame[start] > times[-1]:
                    times.append(w.frame[start])
    assert np.diff(seen[0]) == pytest.approx(0.02)
    assert np.diff(seen[8]) == pytest.approx(0.1)


def test_sensor_noise_and_bias_have_their_size():
    w = world()
    samples = []
    for tick in range(4000):
        w.x[:] = start = world().x  # held still: what varies is the sensor
        w.advance(0.02 * tick)
        samples.append(w.frame.copy())
    samples = np.array(samples[10:])
    truth = euler_from_quaternion(*start[3:7])
    noise = VEHICLE.sensors.attitude.noise
    assert samples[:, 2:5].std(axis=0) == pytest.approx([noise] * 3, rel=0.1)
    assert samples[:, 2:5].mean(axis=0) - truth == pytest.approx(w.errors[0, :3], abs=5 * noise / 40)
    assert samples[:, 5:8].std(axis=0) == pytest.approx([VEHICLE.sensors.gyro.noise] * 3, rel=0.1)


@pytest.mark.parametrize(("scale", "deeper"), [(0.5, False), (-0.5, True)])
def test_effect_drag_slows_or_quickens(scale, deeper):
    nominal = fly(world(), (0.0, -0.02, 0.15))
    other = fly(world(effects={"drag": {"scale": scale}}), (0.0, -0.02, 0.15))
    assert (np.linalg.norm(other[-1, 7:10]) > np.linalg.norm(nominal[-1, 7:10])) == deeper


def test_effect_net_buoyancy_sinks_a_neutral_vehicle():
    assert fly(world(effects={"net_buoyancy": {"mass": 0.02}}))[-1, 2] > 5.2
    assert fly(world())[-1, 2] == pytest.approx(5.0, abs=1e-6)


def test_effect_imu_pitch_bias_is_in_the_reading_only():
    biased = world(effects={"imu_pitch_bias": {"angle": 0.05}})
    plain = world()
    assert fly(biased) == pytest.approx(fly(plain), abs=1e-12)
    for w in (biased, plain):
        w.advance(1.0)
    assert biased.frame[3] - plain.frame[3] == pytest.approx(0.05)


def test_flights_of_one_vehicle_have_its_biases_and_noise_of_their_own():
    same = SampledSensors(biases=1)
    worlds = [build_world(VEHICLE, Environment(**CALM), same, Start(depth_m=5.0), seed) for seed in (0, 1)]
    drawn = [build_world(VEHICLE, Environment(**CALM), SampledSensors(), Start(depth_m=5.0), seed) for seed in (0, 1)]
    assert np.array_equal(worlds[0].errors, worlds[1].errors)
    assert not np.array_equal(drawn[0].errors, drawn[1].errors)
    assert [world.seed for world in worlds] == [world.seed for world in drawn]
    assert worlds[0].seed != worlds[1].seed
