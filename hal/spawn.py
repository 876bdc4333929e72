"""How one of this project's modules is started as a process of its own. Standard library alone.

`-P` keeps the working directory out of the module path, and the folder that `glider` was loaded from leads PYTHONPATH.
Otherwise another package of that name in the working directory would be imported instead.
"""

import os
import sys
from pathlib import Path

ROOT = Path(str(sys.modules["glider"].__file__)).resolve().parents[1]


def module_command(module: str, *arguments: str) -> list[str]:
    """Build the command line that runs a module of this project.

    Args:
        module: its dotted name, for example "glider.hal.recorder.writer".
        arguments: what follows it on the command line.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def module_environment() -> dict[str, str]:
    """Return this process's environment, with the folder of `glider` first in PYTHONPATH."""
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
