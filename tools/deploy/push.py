"""`python -m glider.tools.deploy.push HOST`: installs the committed tree on the glider's computer (`make deploy`).

A release is made here with all its wheels, brought over by ssh, installed beside the one that flies, checked there, and
switched to. Broken off anywhere it is begun again and goes on; what flies is the old release or the new one, whole.
"""

import argparse
import shlex
import subprocess
import sys
from pathlib import Path

from glider.tools.cli.common import BAD_INPUT, DONE, FAILED, progress, say
from glider.tools.data.remote import RemoteError, RemoteHost, host
from glider.tools.deploy.bundle import make_release, release_name, uncommitted
from glider.tools.deploy.wheels import ROOT, Target

INCOMING = "glider-incoming"  # in the home of who logs in, or beside the folder that is installed into
PYTHON = 'import platform as p, sys; print(p.machine(), "%d.%d" % sys.version_info[:2], p.libc_ver()[1] or "2.17")'


def look(vehicle: RemoteHost, python: str, root: str) -> tuple[Target, str, str]:
    """What computer that is, the release that is installed and the one that flies; both empty where none is."""
    opt = f"{shlex.quote(root)}/opt/glider"
    said = vehicle.run(
        f"{shlex.quote(python)} -c {shlex.quote(PYTHON)} && "
        f"echo $(cat {opt}/installed 2>/dev/null) && echo $(readlink {opt}/current)"
    )
    words, installed, current = said.splitlines()
    machine, version, libc = words.split()
    return Target(machine, version, int(libc.split(".")[1])), installed, current.rpartition("/")[2]


def bring(vehicle: RemoteHost, release: Path, root: str) -> str:
    """A release's files into the folder of incoming ones, where those of others are removed. Where they are."""
    incoming = f"{root}.incoming" if root else INCOMING
    folder = f"{incoming}/{release.name}"
    vehicle.run(f'for d in {shlex.quote(incoming)}/*; do [ "$d" = {shlex.quote(folder)} ] || rm -rf "$d"; done')
    files = [path for path in sorted(release.rglob("*")) if path.is_file()]
    with progress(f"to {vehicle.name}", sum(path.stat().st_size for path in files)) as advance:
        vehicle.put({path: f"{folder}/{path.relative_to(release)}" for path in files}, advance)
    return folder


def install(vehicle: RemoteHost, folder: str, words: str, settings: str) -> int:
    """The release's own script, as root; what it says goes to this terminal."""
    script = f"env {settings} sh {shlex.quote(folder)}/install.sh {words}"
    if not settings_root(settings) and words != "list":
        script = f'if [ "$(id -u)" = 0 ]; then {script}; else sudo {script}; fi'
    return subprocess.run(vehicle.command(script, tty=sys.stdin.isatty())).returncode


def settings_root(settings: str) -> str:
    """The folder that is installed into, empty for the system's own."""
    return next((word.partition("=")[2] for word in shlex.split(settings) if word.startswith("ROOT=")), "")


def deploy(vehicle: RemoteHost, build: Path, source: Path, settings: str, python: str) -> int:
    """Make, bring, install; DONE at once where just that release is installed."""
    changed = uncommitted(source)
    if changed:
        say(f"deploy: not committed, and so not deployed: {', '.join(line.split()[-1] for line in changed)}")
    name = release_name(source)
    target, installed, current = look(vehicle, python, settings_root(settings))
    if installed == current == name:
        say(f"deploy: {name} is installed on {vehicle.name}: nothing to do")
        return DONE
    say(f"deploy: {name} for {target}")
    release = make_release(target, build, source)
    folder = bring(vehicle, release, settings_root(settings))
    code = install(vehicle, folder, "install", settings)
    if code == DONE:
        vehicle.run(f"rm -rf {shlex.quote(folder)}")
    return code


def main() -> int:
    """Exit 0: it flies, or did before; 1: it was given up, and what flew before flies; 2: refused."""
    parser = argparse.ArgumentParser(prog="python -m glider.tools.deploy.push", description=__doc__)
    parser.add_argument("host", help="user@glider, as ssh knows it")
    parser.add_argument("--rollback", action="store_true", help="back to the release before")
    parser.add_argument("--list", action="store_true", help="what is installed there; * is what flies")
    parser.add_argument("--root", default="", help="install into this folder there, without users and services")
    parser.add_argument("--python", default="python3", help="Python there")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "deploy", help="folder for releases here")
    parser.add_argument("--source", type=Path, default=ROOT, help="git repository of what is deployed")
    options = parser.parse_args()
    settings = shlex.join([f"ROOT={options.root}", f"PYTHON={options.python}"])
    try:
        with host(options.host) as vehicle:
            if options.rollback or options.list:
                words = "rollback" if options.rollback else "list"
                return install(vehicle, f"{options.root}/opt/glider/current", words, settings)
            return deploy(vehicle, options.build, options.source, settings, options.python)
    except RemoteError as error:
        again = "; run it again, it goes on where it was" if error.lost else ""
        say(f"deploy: {error}{again}")
        return FAILED
    except RuntimeError as error:  # git's and pip's words
        say(f"deploy: {error}")
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
