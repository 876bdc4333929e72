"""`glider missions`: what can be flown by name."""

import click

from glider.tools.cli.common import json_option, print_lines


@click.command()
@json_option
def missions(as_json: bool) -> None:
    """List the shipped missions."""
    from glider.firmware.guidance.mission import decode_mission
    from glider.firmware.model.library import shipped

    found = [decode_mission(text, name) for name, text in shipped("guidance/missions").items()]
    width = max(len(mission.name) for mission in found)
    print_lines(
        [f"{one.name:<{width}}  {one.description} ({len(one.leg)} legs)" for one in found], as_json,
        [{"name": one.name, "legs": len(one.leg), "time_limit_s": one.time_limit_s, "description": one.description}
         for one in found],
    )  # fmt: skip
