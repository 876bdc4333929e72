"""Every command of `glider` called in one process, one after the other: what comes of each, as JSON.

Run by a Python of its own (no pytest, no extras): `python every_command.py CALLS.json`, in the folder of the calls'
files. CALLS.json holds `calls` (a list of arguments each) and `blocked`: modules that this process, and those it
starts, shall not find.
"""

import json
import os
import sys
from pathlib import Path

from commands import glider

HIDE = "import os, sys\nsys.modules.update(dict.fromkeys(os.environ['GLIDER_HIDDEN'].split(), None))\n"


def hide(modules: list[str]) -> None:
    """Make modules impossible to import, here and in processes that this one starts."""
    folder = Path("hiding").resolve()
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(HIDE)
    os.environ["GLIDER_HIDDEN"] = " ".join(modules)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    sys.modules.update(dict.fromkeys(modules, None))


def main() -> None:
    asked = json.loads(Path(sys.argv[1]).read_text())
    hide(asked["blocked"])
    found = []
    for arguments in asked["calls"]:
        done = glider(*arguments, cwd=Path.cwd(), lines="\n" * 100)
        found.append({"arguments": arguments, "code": done.returncode, "out": done.stdout, "err": done.stderr})
    print(json.dumps(found))


if __name__ == "__main__":
    main()
