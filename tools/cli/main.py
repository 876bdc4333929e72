"""`glider`: the one entry point. Commands are imported when called, so that --help stays quick."""

import gc
import importlib
import os
import sys

import click

from glider.tools.cli.common import report_errors
from glider.tools.cli.help import complete
from glider.tools.data.spelling import did_you_mean
from glider.tools.data.version import DISTRIBUTION

# name -> (module of glider.tools, attribute, one line); the line stands here so that --help need not import it.
COMMANDS = {
    "fly": ("cli.fly", "fly", "fly a mission, in simulation or on a board"),
    "live": ("cli.live", "live", "watch a flight in Foxglove while it flies"),
    "missions": ("cli.missions", "missions", "list the missions"),
    "effects": ("cli.effects", "effects", "list the effects that a simulated vehicle can have"),
    "check": ("cli.check", "check", "check vehicle, board and mission files"),
    "status": ("cli.status", "status", "health page of the flight under way"),
    "acknowledge": ("cli.acknowledge", "acknowledge", "a person has looked: the next flight may begin"),
    "compile": ("cli.compile_", "compile_", "compile every kernel ahead"),
    "bench": ("cli.bench", "bench", "bench console: read, jog, sweep, calibrate a board's devices"),
    "twin": ("cli.twin", "twin", "twins of a board's devices on virtual serial ports"),
    "log": ("cli.log", "log", "export, look into or repair an onboard log"),
    "import": ("cli.import_", "import_", "bring other recordings into run data"),
    "export": ("cli.export", "export", "write a case in a format that others read"),
    "gap": ("cli.gap", "gap", "measure and predict: where simulation and sea disagree"),
    "gap challenge": ("verify.challenge.command", "challenge", "a blind test of the diagnosis"),
    "vehicle": ("cli.vehicle", "vehicle", "a first vehicle file by question and answer; a vehicle at a glance"),
    "identify": ("cli.identify", "identify", "parameters and their distribution from runs (MCMC)"),
    "reproduce": ("cli.reproduce", "reproduce", "the paper's figures flown again: pictures and numbers"),
    "campaign": ("cli.campaign", "campaign", "many simulated flights at once, on all cores or on a Dask cluster"),
    "tune": ("cli.tune", "tune", "gains of the pitch and depth PID, by rule or by search"),
    "simulate": ("cli.simulate", "simulate", "open-loop nominal flight from a file of commands"),
    "faults": ("verify.faults.command", "faults", "fly the fault table: noticed after, reaction, how it ended"),
    "benchmark": ("verify.benchmark.command", "benchmark", "the speed figures, each as a ratio in one run"),
}


def _load(name: str) -> click.Command:
    module, attribute, _ = COMMANDS[name]
    return getattr(importlib.import_module(f"glider.tools.{module}"), attribute)


class LazyGroup(click.Group):
    """A group whose commands are imported only when they run."""

    def list_commands(self, ctx):
        return [name for name in COMMANDS if " " not in name]

    def get_command(self, ctx, name):
        if name not in COMMANDS:
            return None
        command = _load(name)
        for below in COMMANDS:
            if below.startswith(f"{name} ") and isinstance(command, click.Group):
                command.add_command(_load(below))
        return complete(command, name)

    def resolve_command(self, ctx, args):
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail(f"No such command '{args[0]}'{did_you_mean(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx, formatter):
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name][2]) for name in self.list_commands(ctx)])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name=DISTRIBUTION)
def cli():
    """Fly an underwater glider, in the sea or in simulation, and find out why the two disagree."""


complete(cli, "")


def main() -> None:
    # Before NumPy is loaded. The kernels share out the work over the cores; threads of the linear algebra beside them
    # would only wait, each keeping a core busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # What a command loads is a hundred thousand objects, none of them garbage: looked through less often.
    gc.set_threshold(20_000, 20, 20)
    sys.exit(report_errors(cli))


if __name__ == "__main__":
    main()
