"""The controllers, a row each for whoever lists them: files and commands read it without loading a compiler."""

from dataclasses import dataclass

from glider.firmware.core.layouts import control_layout as ctl


@dataclass(frozen=True)
class Controller:
    """A row: its name in files and on the command line, its number in C, and its title for a reader.

    law_gains: the table of [control] with the law's gains that it flies by.
    """

    name: str
    number: float
    title: str
    needs_velocities: bool = True
    law_gains: str = "law"


CONTROLLERS = {
    row.name: row
    for row in (
        Controller("pid", ctl.PID, "PID", needs_velocities=False),
        Controller("law", ctl.LAW, "law"),
        Controller("hybrid", ctl.HYBRID, "hybrid"),
        Controller("law+", ctl.LAW_PLUS, "law+", law_gains="law_plus"),
    )
}
