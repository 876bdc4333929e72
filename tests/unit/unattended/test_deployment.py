"""What is put on the glider's computer: units that systemd understands, a script that refuses what it cannot serve."""

import configparser
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from glider.hal.heartbeat import run_folder, state_folder
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile

ROOT = Path(__file__).resolve().parents[3]
DEPLOY = ROOT / "tools" / "deploy"
UNITS = ("glider-outofband.service", "glider-flight@.service")


def unit(name):
    parser = configparser.RawConfigParser(strict=False, interpolation=None)
    parser.optionxform = str
    parser.read_string((DEPLOY / name).read_text())
    return parser


@pytest.mark.parametrize("name", UNITS)
def test_systemd_finds_nothing_wrong_with_a_unit(name, tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd here")
    for other in UNITS:
        text = (DEPLOY / other).read_text()
        for program in ("python", "glider"):
            text = text.replace(f"/opt/glider/releases/@RELEASE@/bin/{program}", sys.executable)
        (tmp_path / other.replace("@.", "@x.")).write_text(text)
    file = tmp_path / name.replace("@.", "@x.")
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(file)], capture_output=True, text=True)
    assert "glider" not in done.stderr, done.stderr


def test_both_units_mean_the_same_folders_and_user(monkeypatch):
    watch, flight = (unit(name)["Service"] for name in UNITS)
    for key in ("User", "RuntimeDirectory", "PrivateNetwork", "NoNewPrivileges"):
        assert watch[key] == flight[key]
    for section in (watch, flight):
        settings = dict(item.split("=", 1) for item in section["Environment"].split())
        monkeypatch.setenv("GLIDER_RUN_DIR", settings["GLIDER_RUN_DIR"])
        monkeypatch.setenv("GLIDER_STATE_DIR", settings["GLIDER_STATE_DIR"])
        assert (str(run_folder()), str(state_folder())) == ("/run/glider", "/var/lib/glider")


def test_a_flight_is_never_started_by_itself():
    """No restart, nothing that pulls it in at boot; the watch is, always."""
    flight, watch = unit(UNITS[1]), unit(UNITS[0])
    assert flight["Service"]["Restart"] == "no"
    assert not {"Requires", "BindsTo", "PartOf", "Requisite"} & set(flight["Unit"])  # these restart what needs them
    assert not flight.has_section("Install")
    assert watch["Service"]["Restart"] == "always"
    assert watch["Install"]["WantedBy"] == "multi-user.target"


def test_the_units_options_exist():
    from glider.tools.cli.fly import fly

    names = {name for option in fly.params for name in option.opts}
    words = unit(UNITS[1])["Service"]["ExecStart"].split()
    assert {word for word in words if word.startswith("--")} <= names


@pytest.fixture
def release(tmp_path):
    """A release's folder without its wheels, for this machine."""
    folder = tmp_path / "release"
    folder.mkdir()
    shutil.copy(DEPLOY / "install.sh", folder)
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    (folder / "RELEASE").write_text(f"release=x\nversion=1\nmachine={os.uname().machine}\npython={version}\n")
    (folder / "SHA256SUMS").write_text("")
    return folder


def install(release, root, **settings):
    environment = {**os.environ, "PYTHON": sys.executable, **settings, "ROOT": str(root)}
    return subprocess.run(["sh", release / "install.sh"], env=environment, capture_output=True, text=True)


def test_the_script_refuses_an_old_python_and_another_machine_before_it_touches_anything(release, tmp_path):
    old = tmp_path / "python3"
    old.write_text("#!/bin/sh\nexit 1\n")
    old.chmod(0o755)
    done = install(release, tmp_path / "root", PYTHON=str(old))
    assert (done.returncode, "Python 3.11 or" in done.stderr) == (2, True)
    text = (release / "RELEASE").read_text()
    (release / "RELEASE").write_text(text.replace(os.uname().machine, "pdp11"))
    done = install(release, tmp_path / "root")
    assert done.returncode == 2
    assert done.stderr.endswith(f" {os.uname().machine}\n")
    (release / "RELEASE").unlink()
    assert install(release, tmp_path / "root").stderr.endswith("make deploy HOST=user@glider\n")
    assert not (tmp_path / "root").exists()


def test_a_release_passes_its_self_check_unless_vehicle_files_or_state_are_against_it(tmp_path):
    """The real one, in a process of its own, on the kernels of this tree."""
    files, state = tmp_path / "etc", tmp_path / "state"
    files.mkdir()
    for path in ("hal/boards/roughie.toml", "firmware/model/vehicles/roughie.toml",
                 "firmware/guidance/missions/sawtooth.toml"):  # fmt: skip
        shutil.copy(ROOT / path, files / {"boards": "board.toml", "vehicles": "vehicle.toml"}.get(
            Path(path).parent.name, "sawtooth.toml"))  # fmt: skip

    def check(**settings):
        command = [sys.executable, "-m", "glider.tools.deploy.selfcheck", "--files", files, "--state", state]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=os.environ | settings)
        return done.returncode, done.stderr.splitlines()[-1]

    code, said = check()
    assert code == 0, said
    assert said.startswith("self-check: flight: ")
    assert said.endswith(" complete")

    # nobody's setting makes a vehicle of plain Python
    code, said = check(GLIDER_JIT="0")
    assert code == 1
    assert re.match(r"self-check: kernels: FAILED: .*\(GLIDER_JIT=0\)", said)

    with (files / "sawtooth.toml").open("a") as file:
        file.write("\nwings = 2\n")
    code, said = check()
    assert code == 1
    assert said.startswith(f"self-check: files: FAILED: {files / 'sawtooth.toml'}")

    StateFile(state).write(SortieState.DIVING, flight="dive")
    code, said = check()
    assert code == 1
    assert said.startswith(f"self-check: state: FAILED: {state}: the flight before (dive): ")


def test_where_no_arm_can_be_emulated_it_says_why(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "glider.tools.verify.arm64.emulated", tmp_path / "arm"], cwd=ROOT, capture_output=True,
        text=True, env={**os.environ, "PATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["skipped"] in ("root is missing", "mmdebstrap is missing")
    assert not (tmp_path / "arm").exists()


def test_the_wishes_are_reported_whatever_comes_of_them():
    """Each is optional: in a process without the right to it, it is said and nothing else happens."""
    code = (
        "import os, resource\n"
        "from glider.hal import realtime as r\n"
        "os.setuid(65534) if os.getuid() == 0 else None\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))\n"
        "print(r.take_priority(50)); print(r.lock_memory()); print(r.pin_to_core(9999)); print(r.pin_to_core(0))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    said = done.stdout.splitlines()
    assert said[0].startswith("ordinary priority (")
    assert said[1].startswith("memory not ")
    assert said[2].startswith("not pinned to core 9999 (")
    assert said[3] in ("core 0", "not pinned to core 0 (Invalid argument)")
