"""What docs/reference/figures.md says of the controllers in the paper's simulations and in rough water, with fewer
seeds."""

import msgspec
import numpy as np
import pytest

from glider.firmware.autopilot import configuration
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.guidance.mission import decode_mission
from glider.firmware.model.gains import Control, Law
from glider.firmware.model.library import shipped
from glider.tools.data.sources import load_vehicle
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.flights import COLUMNS, TUMBLED, FlightJob, cut, fly_chunk
from glider.tools.study.campaign.plan import build_plan, load_campaign
from glider.tools.study.reproduce import tracking
from glider.tools.study.reproduce.design import Variant, fly_design

VEHICLE = load_vehicle("roughie")
NOISE = tracking.PAPER_DISTURBANCE_SCALE * VEHICLE.disturbance.linear
SEEDS = range(100, 106)


def flown(figure, targets, variants, states=("estimated",), noise=NOISE):
    """Tracking error (%) and final error by controller and state: {(name, state): (targets, seeds) each}."""
    legs = {target: figure.leg(target) for target in targets}
    batch = fly_design(VEHICLE, legs, variants, [noise], SEEDS, states)
    shape = (len(states), len(variants), len(targets), len(SEEDS))
    errors = tracking.tracking_error(figure, batch).reshape(shape)
    finals = tracking.final_error(figure, batch).reshape(shape)
    names = [(variant.name, state) for state in states for variant in variants]
    return dict(
        zip(names, zip(errors.reshape(-1, *shape[2:]), finals.reshape(-1, *shape[2:]), strict=True), strict=True)
    )


@pytest.fixture(scope="module")
def steep():
    return flown(tracking.FIG5, (45.0, -45.0), tracking.variants(VEHICLE), ("estimated", "true"))


@pytest.fixture(scope="module")
def ascents():
    return flown(tracking.FIG6, (-2.0, -4.0, -5.0), tracking.variants(VEHICLE))


def test_the_law_is_no_worse_than_the_best_tuned_pid_at_45_degrees(steep):
    law, plus, tuned, ruled = (steep[name, "estimated"][0].mean() for name in ("law", "law+", "pid_tuned", "pid"))
    assert plus < law <= tuned < ruled


def test_estimates_cost_no_more_than_a_third(steep):
    for name in ("law", "hybrid", "pid", "pid_tuned", "law+"):
        assert steep[name, "estimated"][0].mean() <= 1.3 * steep[name, "true"][0].mean()


def test_the_hybrid_ends_no_further_off_than_the_pid(steep):
    assert steep["hybrid", "estimated"][1].mean() <= steep["pid", "estimated"][1].mean()


def test_every_ascent_is_completed(ascents):
    for name, (_, finals) in ascents.items():
        assert (finals <= tracking.COMPLETE_WITHIN).all(), name


def test_the_observer_takes_most_of_the_final_error_away():
    """The filter's model error in f, against none, where the vehicle is not the one in the file; on true attitude.

    On estimates the final error is the attitude sensor's bias, which nothing aboard can see.
    """
    variants = [
        Variant(f"share {share:g}", Control(controller="law", law=Law(observer_share=share))) for share in (0.0, 1.0)
    ]
    finals = [entry[1].mean() for entry in flown(tracking.FIG5, (45.0, -45.0), variants, ("true",), 0.0).values()]
    print(finals)
    assert finals[1] < 0.5 * finals[0]


@pytest.mark.parametrize("controller", ["law", "hybrid", "law+"])
def test_no_flight_tumbles_in_rough_water(controller):
    """Parameters at three times [uncertainty], currents, waves and biases: the worlds of the robustness campaign."""
    campaign, base = load_campaign("robustness")
    plan = build_plan(msgspec.structs.replace(campaign, controllers=[controller], seeds=5, first_seed=900), base)
    job = FlightJob(plan, fingerprint(plan))
    rows = np.concatenate([fly_chunk(job, chunk) for chunk in cut(plan)])
    assert not (rows[:, COLUMNS.index("ended")] == TUMBLED).any()
    assert rows[:, COLUMNS.index("within_limits")].mean() >= 0.9


def test_law_plus_flies_with_gains_of_its_own():
    mission = decode_mission(shipped("guidance/missions")["sawtooth"], "sawtooth")
    for controller, table in (("law", Control().law), ("hybrid", Control().law), ("law+", Control().law_plus)):
        flying = msgspec.structs.replace(mission, control=Control(controller=controller))
        C = configuration(VEHICLE, flying, dt=0.02, periods={"imu": 0.02, "beacon": 0.04, "wires": 0.04})
        pitch, depth = table.pitch, table.depth
        assert C[ctl.PITCH_K1 : ctl.PITCH_EPS + 1].tolist() == [pitch.k1, pitch.k2, pitch.k3, pitch.eps]
        assert C[ctl.DEPTH_K1 : ctl.DEPTH_EPS + 1].tolist() == [depth.k1, depth.k2, depth.k3, depth.eps]
