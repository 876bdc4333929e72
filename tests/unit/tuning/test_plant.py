"""The linearised plant: steady glides are steady, and small steps go the way the flight goes."""

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm

from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run
from glider.tools.data.errors import InputError
from glider.tools.study.tuning.linear_plant import (
    DESIGN_TRIMS,
    LIN_BALLAST,
    LIN_PITCH,
    LIN_Q,
    LIN_SLIDER,
    LIN_U,
    LIN_W,
    OTHER_TRIMS,
    linearise,
    steady_glide,
)


@pytest.mark.parametrize("trim", [*DESIGN_TRIMS, *OTHER_TRIMS], ids=lambda trim: trim.name)
def test_a_steady_glide_stays_as_it_is(vehicle, trim):
    P, state = vehicle.vector(), steady_glide(vehicle.vector(), trim)
    x = flight_state(state)
    nominal_run(P, x, 0.0, state[LIN_SLIDER], state[LIN_BALLAST], 0.0, 0.0, 0.0, 0.01, 2000, np.zeros((5, layout.N_X)))
    assert euler_from_quaternion(*x[3:7])[1] == pytest.approx(trim.pitch, abs=1e-6)
    assert x[layout.X_NU] == pytest.approx(state[LIN_U], abs=1e-6)
    # heavy sinks, light rises, nose in the same direction
    assert np.sign(x[2]) == np.sign(trim.ballast)


def flight_state(state):
    x = np.zeros(layout.N_X)
    x[3:7] = quaternion_from_euler(0.0, state[LIN_PITCH], 0.0)
    x[layout.X_NU], x[layout.X_NU + 2], x[layout.X_NU + 4] = state[LIN_U], state[LIN_W], state[LIN_Q]
    x[layout.X_ACT + 1], x[layout.X_ACT + 2] = state[LIN_SLIDER], state[LIN_BALLAST]
    return x


@pytest.mark.parametrize("trim", DESIGN_TRIMS, ids=lambda trim: trim.name)
@pytest.mark.parametrize("step", [(2e-5, 0.0), (0.0, 2e-4)], ids=["slider", "ballast"])
def test_a_small_step_of_a_command_goes_as_the_flight_does(vehicle, trim, step):
    """Over 10 s, to 0.2 % of the response's largest value; the steps are small enough for no rate limit."""
    P, plant = vehicle.vector(), linearise(vehicle.vector(), trim)
    state = steady_glide(P, trim)
    stepped, steady = flight_state(state), flight_state(state)
    wanted, got = [], []
    augmented = np.zeros((9, 9))
    augmented[:7, :7], augmented[:7, 7:] = plant.A, plant.B
    one = expm(0.5 * augmented)
    x = np.array([*np.zeros(7), *step])
    for _ in range(20):
        for flown, (slider, ballast) in ((stepped, step), (steady, (0.0, 0.0))):
            nominal_run(
                P, flown, 0.0, state[LIN_SLIDER] + slider, state[LIN_BALLAST] + ballast, 0.0, 0.0, 0.0, 0.01, 50,
                np.zeros((5, layout.N_X)),
            )  # fmt: skip
        x = one @ x
        wanted.append([x[LIN_PITCH], x[0]])
        pitches = [euler_from_quaternion(*flown[3:7])[1] for flown in (stepped, steady)]
        got.append([pitches[0] - pitches[1], stepped[2] - steady[2]])
    wanted, got = np.array(wanted), np.array(got)
    assert (np.abs(got - wanted).max(axis=0) < 0.002 * np.abs(wanted).max(axis=0)).all()


def test_a_vehicle_without_a_glide_says_so(vehicle):
    slider = msgspec.structs.replace(vehicle.actuators.slider, range=(-0.001, 0.001))
    actuators = msgspec.structs.replace(vehicle.actuators, slider=slider)
    stuck = msgspec.structs.replace(vehicle, actuators=actuators)
    with pytest.raises(InputError, match="dive -20 deg"):
        linearise(stuck.vector(), DESIGN_TRIMS[0])
