"""`glider missions`: what can be flown by name."""

import click

from glider.tools.cli.common import json_option, print_json


@click.command()
@json_option
def missions(as_json: bool) -> None:
    """List the shipped missions."""
    from glider.firmware.guidance.mission import decode_mission
    from glider.firmware.model.library import shipped

    found = [decode_mission(text, name) for name, text in shipped("guidance/missions").items()]
    if as_json:
        print_json(
            [
                {"name": m.name, "legs": len(m.leg), "time_limit_s": m.time_limit_s, "description": m.description}
                for m in found
            ]
        )
        return
    width = max(len(mission.name) for mission in found)
    for mission in found:
        click.echo(f"{mission.name:<{width}}  {mission.description} ({len(mission.leg)} legs)")
