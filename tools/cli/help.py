"""What every --help has beside its text: examples, kept here in one table, and group lists with whole sentences."""

import inspect
import re

import click

# command -> lines that can be typed as they stand, with a user's own names of files
EXAMPLES = {
    "": [
        "glider fly --mission spiral",
        "glider log export spiral-001.mcap",
        "glider gap diagnose spiral-001 --out answer",
    ],
    "fly": [
        "glider fly --mission spiral --seed 3",
        "glider fly --mission spiral --effect drag:scale=0.3",
        "glider fly --realtime --live",
        "glider fly --board board.toml --mission dive.toml --log dive.mcap",
    ],
    "live": ["glider live user@glider", "glider live --layout foxglove.json"],
    "missions": ["glider missions"],
    "effects": ["glider effects", "glider effects drag"],
    "check": ["glider check --mission dive.toml --vehicle mine.toml", "glider check --board board.toml --signs"],
    "status": ["glider status", "glider status --json"],
    "acknowledge": ["glider acknowledge"],
    "compile": ["glider compile"],
    "bench": [
        "glider bench --board twin",
        "glider bench --board board.toml --script commands.txt --out sweeps",
    ],
    "twin": ["glider twin --dir twins --stand", "glider twin --dir twins --fault 'beacon silent'"],
    "log": ["glider log info spiral-001.mcap", "glider log export spiral-001.mcap"],
    "log info": ["glider log info spiral-001.mcap"],
    "log replay": ["glider log replay spiral-001.mcap"],
    "log export": [
        "glider log export spiral-001.mcap",
        "glider log export spiral-001.mcap spiral-002.mcap --out spirals",
    ],
    "log repair": ["glider log repair spiral-001.mcap --out whole.mcap"],
    "log fetch": ["glider log fetch user@glider", "glider log fetch user@glider 'spiral-*' --out logs"],
    "import": ["glider import csv dive.csv --map map.toml --out dive"],
    "import csv": ["glider import csv dive1.csv dive2.csv --map map.toml --out dives"],
    "import qualisys": ["glider import qualisys capture.tsv --log spiral-001 --out captured"],
    "import slocum": ["glider import slocum unit-2020-100-0-0.dbd unit-2020-100-0-0.ebd --out mission"],
    "import seaglider": ["glider import seaglider p0010001.nc p0010002.nc --out mission"],
    "import seaexplorer": ["glider import seaexplorer sea001.1.gli.sub.1 sea001.1.pld1.sub.1 --out mission"],
    "import og1": ["glider import og1 mission.nc --out mission"],
    "import rosbag": [
        "glider import rosbag dive1 --map ros-imu --out dives", "glider import rosbag --template map.toml",
    ],
    "import ardusub": ["glider import ardusub 00000012.BIN --map ardusub-bin --out dives"],
    "export": ["glider export og1 mission --out mission.nc", "glider export sdf identified.toml --out model.sdf"],
    "export parquet": ["glider export parquet dives --out parquet"],
    "export parameters": ["glider export parameters identified.toml --as python --out vehicle.py"],
    "export fossen": ["glider export fossen answer/corrected.toml --speed 0.3 --as json"],
    "export sdf": ["glider export sdf identified.toml --out model.sdf"],
    "export stonefish": ["glider export stonefish identified.toml --area 0.02 --out body.xml"],
    "export og1": ["glider export og1 mission --out mission.nc --with answer"],
    "gap": ["glider gap measure spiral-001", "glider gap diagnose spiral-001 --out answer"],
    "gap readings": ["glider gap readings spiral-001"],
    "gap measure": ["glider gap measure spiral-001 --report gap.html", "glider gap measure dives --vehicle mine.toml"],
    "gap predict": ["glider gap predict spiral-001/run00.csv --out predicted.csv"],
    "gap diagnose": [
        "glider gap diagnose spiral-001 --out answer",
        "glider gap diagnose dives --vehicle identified.toml --reference healthy --out answer",
        "glider gap diagnose monday tuesday --out answers --jobs 2",
    ],
    "gap watch": ["glider gap watch dives --reference healthy --out watched"],
    "gap velocity": ["glider gap velocity mission --model identified.toml --out velocity"],
    "gap report": ["glider gap report answer"],
    "gap challenge": ["glider gap challenge make --out blind --seed 7 --single 10"],
    "gap challenge make": ["glider gap challenge make --out blind --seed 7 --single 10 --none 5 --pairs 0 --unknown 0"],
    "gap challenge run": ["glider gap challenge run --cases blind --out answers --jobs 2"],
    "gap challenge score": [
        "glider gap challenge score --cases blind --answers blind/answers.zip --diagnoses answers",
    ],
    "vehicle": ["glider vehicle show", "glider vehicle new mine.toml"],
    "vehicle new": ["glider vehicle new mine.toml --name mine"],
    "vehicle show": ["glider vehicle show mine.toml"],
    "identify": ["glider identify dives --out identified"],
    "reproduce": ["glider reproduce fig5 fig6 --out pictures"],
    "campaign": [
        "glider campaign",
        "glider campaign --mission spiral --controller pid --controller law --seeds 100 --out flights",
        "glider campaign --design identification --out captured",
    ],
    "tune": ["glider tune --vehicle mine.toml", "glider tune --method search --budget 60"],
    "simulate": ["glider simulate commands.csv --out flown.csv --water 0.1,0"],
    "faults": ["glider faults --only 12"],
    "benchmark": ["glider benchmark --only tick,plant"],
}  # fmt: skip


def first_sentence(text: str) -> str:
    """The first sentence of a command's help, without its full stop."""
    paragraph = " ".join(inspect.cleandoc(text).split("\n\n")[0].split())
    return re.split(r"\.\s+(?=[A-Z`])", paragraph)[0].removesuffix(".")


def complete(command: click.Command, name: str) -> click.Command:
    """Give a command and those below it their examples and, for the list of their group, their first sentence whole."""
    if command.short_help is not None:  # done before
        return command
    command.short_help = first_sentence(command.help or "")
    if name in EXAMPLES:
        lines = ["Examples:", *(f"  {line}" for line in EXAMPLES[name])]
        own = "" if command.epilog is None else f"{command.epilog}\n\n"
        command.epilog = own + "\b\n" + "\n".join(lines)
    if isinstance(command, click.Group):
        for sub in command.commands.values():
            complete(sub, f"{name} {sub.name}".strip())
    return command
