"""The kernels of many flights side by side compiled ahead (tools/flight/precompile), before a campaign, a search of
gains or a figure of the paper flies them: what flies alone does without."""

from glider.firmware.core.jit import kernel_count
from glider.tools.flight.precompile import EFFECTS, Work


def _fly_a_moment() -> None:
    """Two flights as campaigns and tunings fly them, one of them with effects."""
    import numpy as np

    from glider.sim_backend.board import world_of
    from glider.sim_backend.core.closed_loop import N_TRACE
    from glider.sim_backend.fleet import fly_fleet, fly_group
    from glider.tools.flight.compose import build_flight

    flights = [build_flight(mission="sawtooth", effects=effects) for effects in ({}, EFFECTS)]
    worlds, pilots = [world_of(flight.board) for flight in flights], [flight.autopilot for flight in flights]
    fly_fleet(worlds, pilots, max_seconds=2.0, trace_every=1.0)
    fly_group(worlds[:1], pilots[:1], 0, 1, np.zeros((1, 1, N_TRACE)))


CAMPAIGN = Work("campaign", kernel_count, _fly_a_moment)
