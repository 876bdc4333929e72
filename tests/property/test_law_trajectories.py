"""The law closed around the plant: V along flights, with ideal actuators and with the vehicle's own.

docs/explanation/control.md states what is checked here and gives the same figures.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import Phase, given
from hypothesis import strategies as st

from glider.firmware.core.control.control import roll_law
from glider.firmware.core.control.input_forms import exact_form, paper_form
from glider.firmware.core.control.law import decrease_margin, k2_to_cover
from glider.firmware.core.control.law_plus import JERK_RATE_SHARE, on_outputs
from glider.firmware.core.maths.rotations import euler_from_quaternion
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_rates, limited
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import decode_vehicle
from tests.support.examples import examples
from tests.support.law_flights import (
    SLIDER,
    TICK,
    Gains,
    Law,
    NoInputs,
    Reference,
    advance,
    down,
    form_at,
    lyapunov_rate,
    output_accelerations,
    outputs,
    plant_rates,
    without_stops,
    worst,
)
from tests.support.model_states import HIGH, LOW, RATE, VEHICLE_TEXT, P, state

pytestmark = pytest.mark.computes(seconds=10)

SIGMA = parameter_sigma(P, decode_vehicle(VEHICLE_TEXT, "roughie").uncertainty)
STEP = 0.004  # s, of the flights with ideal actuators
HELD = 2e-4  # rad/s, m/s: what s may do beside the equations while the actuators are held for a step
few = examples(12, phases=[Phase.generate])


# --- ideal actuators: V falls outside the layer, the layer is reached and kept ----------------------------------------


def begin(errors, rolled: float) -> tuple[np.ndarray, tuple[Reference, Reference]]:
    """A glide, and references that it misses by `errors` (pitch rad, depth m)."""
    x = state((rolled, -0.3, 0.5), (0.35, 0.02, 0.03, 0.05, -0.05, 0.05), (rolled, 0.0, 0.05), (0.0, 0.0, 3.0))
    theta, theta_rate, Z, Z_rate = outputs(x)
    return x, (Reference(theta - errors[0], theta_rate), Reference(Z - errors[1], Z_rate))


def ideal_flight(law: Law, true: np.ndarray, errors, rolled, strength, cover: float, seconds: float):
    """s and V_dot of both axes step by step, (n, 2) each, against the worst disturbance of `strength` (2,).

    At each step the actuators are put where the law wants them; k2 is `cover` times what covers. References go to a
    dive.
    """
    x, references = begin(errors, rolled)
    work, spread = np.zeros((5, layout.N_X)), 3.0 * SIGMA
    s_of, rate_of = [], []
    for _ in range(round(seconds / STEP)):
        for _ in range(3):  # k2, the inputs and the bound settle together
            _, _, g_ts, _, _, g_zb = form_at(law.vehicle, x)
            bound = law.error_bound(x, spread)
            axes = zip(bound.tolist(), strength.tolist(), (g_ts, g_zb), law.eps, strict=True)
            law = law.with_k2(*(cover * k2_to_cover(*numbers) for numbers in axes))
            x[SLIDER:] = law(x, references)[0]
        _, s, _ = law(x, references)
        acc = worst(x, s, strength)
        s_of.append(s)
        rate_of.append(lyapunov_rate(law, true, x, references, x[layout.X_ACT :], acc))
        advance(true, x, x[layout.X_ACT :], acc, STEP, work)
        references = references[0].step(-0.5, 0.4, STEP), references[1].step(6.0, 0.1, STEP)
    return np.array(s_of), np.array(rate_of)


signs = st.lists(st.sampled_from([-1.0, 1.0]), min_size=layout.N_P, max_size=layout.N_P)
error_pairs = st.tuples(st.sampled_from([-0.3, 0.4]), st.sampled_from([-0.5, 0.6]))
some_gains = st.tuples(st.floats(0.4, 1.0), st.floats(0.2, 0.8), st.floats(0.01, 0.03))


@few
@given(signs, error_pairs, st.floats(-0.6, 0.6), some_gains, some_gains)
def test_V_falls_to_the_layer_and_stays_there(corner, errors, rolled, pitch, depth):
    """Any corner of three sigma, the worst disturbance of 0.03 rad/s2 and 0.02 m/s2, k2 two per cent above its cover.

    Outside the layer V falls at every step, and |s| <= max(eps, |s_0| exp(-k3 t)): the layer is reached in
    ln(|s_0|/eps)/k3 at the latest, and once in, s stays.
    """
    true = without_stops(P + 3.0 * SIGMA * np.array(corner))
    law = Law(without_stops(P), gains_of(pitch), gains_of(depth))
    s, V_dot = ideal_flight(law, true, errors, rolled, np.array([0.03, 0.02]), 1.02, 14.0)
    size, (_, _, k3, eps) = np.abs(s), law.coefficients()
    outside = size >= eps
    assert (outside.sum(axis=0) > 100).all()  # the flights begin outside
    assert (V_dot[outside] < 0.0).all()
    assert (np.diff(size, axis=0)[outside[:-1]] < 0.0).all()
    envelope = np.maximum(eps, size[0] * np.exp(-k3 * STEP * np.arange(len(s))[:, None]))
    assert (size <= envelope + HELD).all()
    assert not outside[-1].any()


def gains_of(numbers) -> Gains:
    k1, k3, eps = numbers
    return Gains(k1, 0.0, k3, eps)


def test_the_same_adversary_wins_against_less():
    """A tenth of the k2 that covers, in a vehicle whose errors all pull one way: s is kept out of the layer."""
    law = Law(without_stops(P), Gains(0.5, 0.0, 0.2, 0.01), Gains(0.4, 0.0, 0.2, 0.01))
    x, _ = begin((0.3, 0.5), 0.3)
    pull = np.zeros(layout.N_P)
    for n in np.flatnonzero(SIGMA):
        off = without_stops(P + 3.0 * SIGMA * (np.arange(layout.N_P) == n))
        a, b = (output_accelerations(x, plant_rates(v, x, x[layout.X_ACT :])[7:13]) for v in (off, law.vehicle))
        pull[n] = np.sign((a - b)[0])
    true = without_stops(P + 3.0 * SIGMA * pull)
    held = {}
    for cover in (0.1, 1.02):
        s, _ = ideal_flight(law, true, (0.3, 0.5), 0.3, np.array([0.03, 0.02]), cover, 14.0)
        held[cover] = np.abs(s[-200:]).min(axis=0)
    assert (held[0.1] > 0.01).all()
    assert (held[1.02] < 0.01).all()


# --- the vehicle's own actuators --------------------------------------------------------------------------------------

MODERATE = Gains(0.8, 0.01, 0.8, 0.1), Gains(0.3, 0.05, 0.4, 0.05)
FAST = Gains(1.5, 0.02, 2.0, 0.05), Gains(0.5, 0.2, 1.0, 0.03)
SUB_STEPS = 4  # plant steps in a tick
RANGES = LOW.tolist(), HIGH.tolist(), RATE.tolist()
LEGS = ((0.0, -0.5, 4.0, 0.0), (30.0, 0.5, 1.0, 0.4))  # from s, pitch rad, depth m, roll rad


@dataclass
class Watch:
    """How often, by axis, s was outside its layer and V was promised to fall, and where the promise was broken."""

    steps: int = 0
    outside: np.ndarray = field(default_factory=lambda: np.zeros(2, dtype=int))
    promised: np.ndarray = field(default_factory=lambda: np.zeros(2, dtype=int))
    promised_outside: np.ndarray = field(default_factory=lambda: np.zeros(2, dtype=int))
    broken: list = field(default_factory=list)

    def look(self, law: Law, true, x, references, command, acc) -> None:
        """Compare what decrease_margin promises at this step with the plant's own V_dot."""
        speeds = actuator_rates(P, *x[layout.X_ACT :].tolist(), *command.tolist())
        # with the speeds there are now: what the actuators are short of is all that is left
        wanted, s, g = replace(law, counting_on="joint")(x, references, speeds)
        mismatch = np.reshape(form_at(law.vehicle, x, speeds)[2:], (2, 2)) @ (x[SLIDER:] - wanted)
        bound, disturbance = law.error_bound(x, 3.0 * SIGMA, speeds), np.abs(on_outputs(*down(x), *acc))
        V_dot, jerks = lyapunov_rate(law, true, x, references, command, acc), law.jerks(g)
        self.steps += 1
        for axis, gains in enumerate((law.pitch, law.depth)):
            margin = decrease_margin(
                s[axis], g[axis], gains.k2, gains.k3, gains.eps, jerks[axis],
                mismatch[axis], bound[axis], disturbance[axis],
            )  # fmt: skip
            away = abs(s[axis]) >= gains.eps
            self.outside[axis] += away
            if margin > 0.0:
                self.promised[axis] += 1
                self.promised_outside[axis] += away
                if V_dot[axis] > -abs(s[axis]) * margin + 1e-12 or V_dot[axis] >= 0.0:
                    self.broken.append((axis, s[axis], margin, V_dot[axis]))


def real_flight(
    law: Law, seed: int, *, form=exact_form, strength=0.003, watch=None,
    seconds=60.0, missed=(0.0, 0.0),
):  # fmt: skip
    """Pitch and depth errors tick by tick, (n, 2), and commands, (n, 3), of a dive and a climb of 30 s each.

    The plant's vehicle is drawn from [uncertainty], its disturbance held 0.1 s; lag, rate and range are its own, and
    every command goes through `limited`. References begin `missed` beside the vehicle. Where the law has no inputs, the
    last command stays. With `watch`, it looks at each step of the plant.
    """
    rng = np.random.default_rng(seed)
    true = P + SIGMA * np.clip(rng.standard_normal(layout.N_P), -3.0, 3.0)
    work = np.zeros((5, layout.N_X))
    x = state(nu=(0.2, 0.0, 0.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, 1.0))
    references = Reference(-missed[0]), Reference(1.0 - missed[1])
    command = np.zeros(3)
    errors, commands = [], []
    for tick in range(round(seconds / TICK)):
        if tick % 5 == 0:
            acc = strength * rng.standard_normal(6)
        _, pitch, depth, roll = [leg for leg in LEGS if leg[0] <= tick * TICK + 1e-9][-1]
        references = references[0].step(pitch, 0.4, TICK), references[1].step(depth, 0.1, TICK)
        speeds = actuator_rates(P, *x[layout.X_ACT :].tolist(), *command.tolist())
        theta, _, Z, _ = outputs(x)
        try:
            inputs = law(x, references, speeds, form=form)[0]
        except NoInputs:
            inputs = command[1:]
        rolled = euler_from_quaternion(*x[3:7].tolist())[0]
        wanted = roll_law(roll, 0.0, rolled, float(x[10]), 0.3, 0.2), *inputs.tolist()
        command = np.array([limited(*a, TICK) for a in zip(wanted, command.tolist(), *RANGES, strict=True)])
        errors.append((theta - references[0].position, Z - references[1].position))
        commands.append(command)
        for _ in range(SUB_STEPS):
            if watch is not None:
                watch.look(law, true, x, references, command, acc)
            advance(true, x, command, acc, TICK / SUB_STEPS, work)
    return np.array(errors), np.array(commands)


@pytest.mark.parametrize("counting_on", ["present", "reach"])
@pytest.mark.parametrize("share", [None, JERK_RATE_SHARE])
def test_V_falls_with_real_actuators_whenever_the_margin_says_so(counting_on, share):
    """|feedback| > |mismatch| + model error + disturbance makes V fall, and by that much.

    Flights from off the reference, where s is worth bringing in, in vehicles of the box: often enough promised.
    """
    watch = Watch()
    for seed in range(6):
        missed = (0.3, -0.6) if seed % 2 else (-0.3, 0.6)
        law = Law(P, *MODERATE, counting_on, share)
        real_flight(law, seed, strength=0.003, watch=watch, seconds=10.0, missed=missed)
    print(
        f"\n{counting_on}, share {share}: of {watch.steps} steps outside {watch.outside}, promised {watch.promised}, "
        f"both {watch.promised_outside}"
    )
    assert not watch.broken
    assert (watch.outside > 0.1 * watch.steps).all()
    assert (watch.promised_outside > 0.3 * watch.outside).all()


# --- what the parts are worth: the figures of docs/explanation/control.md
# --------------------------------------------------------

VARIANTS = {
    "moderate, joint": (MODERATE, dict(counting_on="joint"), {}),
    "moderate, present": (MODERATE, dict(counting_on="present"), {}),
    "moderate, present, paper form": (MODERATE, dict(counting_on="present"), dict(form=paper_form)),
    "moderate, reach": (MODERATE, dict(counting_on="reach"), {}),
    "moderate, law+": (MODERATE, dict(counting_on="reach", share=JERK_RATE_SHARE), {}),
    "moderate, law+, paper form": (MODERATE, dict(counting_on="reach", share=JERK_RATE_SHARE),
    dict(form=paper_form)), "fast, present": (FAST, dict(counting_on="present"), {}),
    "fast, law+": (FAST, dict(counting_on="reach", share=JERK_RATE_SHARE), {}),
}  # fmt: skip


@pytest.fixture(scope="module")
def figures() -> dict[str, np.ndarray]:
    """Per variant, means over three vehicles: rms of pitch (rad) and depth (m), final errors, slider's travel (m)."""
    rows = {}
    print(
        "\n| gains, variant | pitch rms, rad | depth rms, m | pitch at the end, rad | depth at the end, m | travel, m |"
    )
    for name, (gains, law, flight) in VARIANTS.items():
        flown = [real_flight(Law(P, *gains, **law), seed, **flight) for seed in range(3)]
        rows[name] = np.mean([
            [*np.sqrt((errors**2).mean(axis=0)), *np.abs(errors[-100:]).mean(axis=0),
             np.abs(np.diff(commands[:, 1])).sum()]
            for errors, commands in flown
        ], axis=0)  # fmt: skip
        print(f"| {name} | " + " | ".join(f"{value:.2g}" for value in rows[name]) + " |")
        for _, commands in flown:
            assert ((commands >= LOW) & (commands <= HIGH)).all()
            assert (np.abs(np.diff(commands, axis=0)) <= RATE * TICK * (1.0 + 1e-9)).all()
    return rows


def test_solved_jointly_the_slider_stands_against_ballast_that_is_not_there(figures):
    assert figures["moderate, joint"][0] > 4.0 * figures["moderate, present"][0]
    assert figures["moderate, joint"][1] > 4.0 * figures["moderate, present"][1]
    assert figures["moderate, present"][0] < 0.02


def test_gains_past_the_actuators_lose_the_vehicle_and_law_plus_keeps_it(figures):
    assert figures["fast, present"][0] > 0.2
    assert figures["fast, law+"][0] < 0.02
    assert figures["fast, law+"][1] < 0.05


def test_paper_form_costs_the_law_tracking_of_pitch(figures):
    assert figures["moderate, present, paper form"][0] > 1.2 * figures["moderate, present"][0]
