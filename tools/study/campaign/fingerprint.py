"""A fingerprint of every number behind a campaign's flights: results are added up only where they agree in it."""

import hashlib
from pathlib import Path

import msgspec
import numpy as np

from glider.firmware.core.jit import kernels_digest
from glider.tools.data.version import release
from glider.tools.study.campaign.plan import CampaignPlan
from glider.tools.study.campaign.worlds import draw_world


def fingerprint(plan: CampaignPlan) -> str:
    """Hash over the campaign, this software, and the arrays that flights are made of, 16 hex digits.

    Gains, references, a vehicle's numbers or the way worlds are drawn may change with nothing changed in the campaign:
    the arrays tell, and the files that draw and count.
    """
    digest = hashlib.sha256()
    for part in (plan.campaign, plan.board):
        digest.update(msgspec.json.encode(part))
    digest.update(f"{release()} {kernels_digest()}".encode())
    for name in ("flights.py", "worlds.py"):  # what is counted, and how worlds are drawn
        digest.update(Path(__file__).with_name(name).read_bytes())
    for number, mission in enumerate(plan.missions):
        for controller in plan.campaign.controllers:
            pilot = plan.pilot(number, controller)
            for array in (pilot.P, pilot.C, pilot.legs, pilot.nav):
                digest.update(array.tobytes())
        digest.update(mission.name.encode())
        world = draw_world(plan, number, plan.campaign.first_seed).world
        for array in (
            world.P, world.E, world.F, world.waves, world.sensors, world.errors, np.array(world.seed), world.x,
        ):  # fmt: skip
            digest.update(array.tobytes())
    return digest.hexdigest()[:16]
