"""Register maps that no shipped device has: other addresses, other places in the block, other types, other scales."""

from pathlib import Path

from glider.tools.data.boards import load_board_file

# Its number begins where it begins in no shipped map, between registers that hold something else.
DRIVE = """
format = 1
name = "other-drive"
role = "drive"

[block.status]
function = 4
address = 0x0200
count = 3
value.status = { at = 1, type = "u32" }

[block.position]
address = 0x0300
count = 5
value.position = { at = 2, type = "i32", unit = "counts" }

[block.position_low]
address = 0x0301
count = 3
value.position = { at = 2, type = "u16", unit = "counts" }

[block.path]
address = 0x0400
count = 11
value.position = { at = 0, type = "i32", unit = "counts" }
value.speed = { at = 2, type = "u32", unit = "rpm", scale = 0.1 }
value.acceleration = { at = 4, type = "u16", unit = "ms per 1000 rpm" }
value.deceleration = { at = 5, type = "i16", unit = "ms per 1000 rpm" }
value.pause = { at = 6, type = "u16", unit = "ms" }
value.trigger = { at = 7, type = "u32" }
value.mode = { at = 9, type = "u32" }

[word]
control = 0x0500
auxiliary = 0x0501

[command]
absolute = 3
trigger = 7
quick_stop = 9
clear_alarm = 55
"""

ENCODER = """
format = 1
name = "other-encoder"
role = "encoder"

[block.all]
function = 4
address = 0x0010
count = 4
value.count = { at = 1, type = "i32", unit = "counts" }

[block.low]
function = 4
address = 0x0011
count = 2
value.count = { at = 1, type = "u16", unit = "counts" }
"""

ANALOG = """
format = 1
name = "other-analog"
role = "analog"

[block.all]
function = 4
address = 0x0040
count = 12
value.channel = { at = 3, type = "u32", scale = 0.5 }
"""

PRESSURE = """
format = 1
name = "other-transmitter"
role = "pressure"

[block.all]
function = 4
address = 0x0020
count = 6
value.pressure = { at = 3, type = "i32", unit = "mbar", scale = 0.1 }
value.temperature = { at = 1, type = "i16", unit = "deg C", scale = 0.01 }
"""


def write_maps(folder: Path) -> dict[str, str]:
    """The maps as files; their paths by name."""
    paths = {}
    for name, text in (("drive", DRIVE), ("encoder", ENCODER), ("analog", ANALOG), ("pressure", PRESSURE)):
        path = folder / f"{name}.toml"
        path.write_text(text)
        paths[name] = str(path)
    return paths


def board_text(maps: dict[str, str]) -> str:
    """The shipped board file with these maps; the plunger's draw-wire is an encoder on the drives' line."""
    text = load_board_file("roughie").text
    for shipped, name in (("leadshine-cs2rs", "drive"), ("waveshare-8ai", "analog"), ("keller-33x", "pressure")):
        text = text.replace(f'device = "{shipped}"', f'device = "{maps[name]}"')
    head, rest = text.split("\n[plunger_wire]\n")
    _, tail = rest.split("\n[leak]\n")
    wire = f'device = "{maps["encoder"]}"\nport = "drives"\nid = 3\nper_m = 2000000.0\nrange_m = [-0.045, 0.045]\n'
    return f"{head}\n[plunger_wire]\n{wire}zero = 0.0\n\n[leak]\n{tail}"
