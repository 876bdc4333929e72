"""Every command of `glider` called in one process, one after the other: what comes of each, as JSON.

Run by a Python of its own (no pytest, no extras): `python every_command.py CALLS.json`, in the folder of the calls'
files. CALLS.json is a list of arguments each.
"""

import json
import sys
from pathlib import Path

from commands import glider


def main() -> None:
    found = []
    for arguments in json.loads(Path(sys.argv[1]).read_text()):
        done = glider(*arguments, cwd=Path.cwd(), lines="\n" * 100)
        found.append({"arguments": arguments, "code": done.returncode, "out": done.stdout, "err": done.stderr})
    print(json.dumps(found))


if __name__ == "__main__":
    main()
