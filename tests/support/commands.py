"""A command of `glider` called in this process: as from a shell, without the wait for a new Python to begin."""

import contextlib
import io
import subprocess
import sys
import traceback
from pathlib import Path


def glider(*arguments: object, cwd: Path, lines: str = "") -> subprocess.CompletedProcess[str]:
    """What came of it: exit code, standard output and error; `lines` is standard input. -1: it ended in a traceback."""
    from glider.tools.cli.common import report_errors
    from glider.tools.cli.main import cli

    words = [str(argument) for argument in arguments]
    out, err, code, before = io.StringIO(), io.StringIO(), -1, (sys.argv, sys.stdin)
    sys.argv, sys.stdin = ["glider", *words], io.StringIO(lines)
    try:
        with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                code = report_errors(cli)
            except BaseException:
                traceback.print_exc()
    finally:
        sys.argv, sys.stdin = before
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())
