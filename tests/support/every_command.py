"""Every command of `glider` called in one process, one after the other: what comes of each, as JSON.

Run by a Python of its own (no pytest, no extras): `python every_command.py CALLS.json`, in the folder of the calls'
files. CALLS.json holds `calls` (a list of arguments each) and `blocked`: modules that this process, and those it
starts, shall not find.
"""

import contextlib
import io
import json
import os
import sys
import traceback
from pathlib import Path

HIDE = "import os, sys\nsys.modules.update(dict.fromkeys(os.environ['GLIDER_HIDDEN'].split(), None))\n"


def hide(modules: list[str]) -> None:
    """Make modules impossible to import, here and in processes that this one starts."""
    folder = Path("hiding").resolve()
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(HIDE)
    os.environ["GLIDER_HIDDEN"] = " ".join(modules)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    sys.modules.update(dict.fromkeys(modules, None))


def call(arguments: list[str]) -> dict:
    """One command: its exit code (None: it ended in a traceback), standard output and standard error."""
    from tools.cli.common import report_errors
    from tools.cli.main import cli

    out, err = io.StringIO(), io.StringIO()
    sys.argv, sys.stdin, code = ["glider", *arguments], io.StringIO("\n" * 100), None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = report_errors(cli)
        except BaseException:
            traceback.print_exc()
    return {"arguments": arguments, "code": code, "out": out.getvalue(), "err": err.getvalue()}


def main() -> None:
    asked = json.loads(Path(sys.argv[1]).read_text())
    hide(asked["blocked"])
    print(json.dumps([call(arguments) for arguments in asked["calls"]]))


if __name__ == "__main__":
    main()
