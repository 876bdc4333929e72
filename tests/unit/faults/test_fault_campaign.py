"""The fault campaign: every row has cases, cases pass, switched off they fail, and it knows a lost vehicle."""

import json

import pytest
from click.testing import CliRunner

from glider.firmware.faults import FAULTS
from glider.tools.verify.faults import campaign
from glider.tools.verify.faults.campaign import FaultOutcome, everything, jobs, run, summary
from glider.tools.verify.faults.cases import FaultCase, Show
from glider.tools.verify.faults.scene import PHASES

pytestmark = pytest.mark.computes(seconds=10)

# One quick case for each row that is flown; the whole campaign is `glider faults`.
QUICK = {1: "imu silent", 2: "beacon off", 4: "plunger_wire off", 6: "imu backwards", 10: "imu garbage", 15: "past",
         16: "slider alarm kept", 20: "leak", 22: "no number", 24: "every tick late",
         35: "no number in the filter"}  # fmt: skip
SHOWN = (7, 8, 9, 12, 26, 29, 30, 34)


def first(row: int, name: str = "", phase: str | None = None) -> tuple[int, str]:
    cases = everything()
    return next(
        job
        for job in jobs(row)
        if cases[job[0]].name.startswith(name) and (phase is None or job[1] == phase or isinstance(cases[job[0]], Show))
    )


def test_every_row_of_the_table_has_a_case():
    assert {case.row for case in everything()} == set(FAULTS)


def test_every_phase_of_a_mission_has_faults_begin_in_it():
    cases = everything()
    seen = {phase for index, phase in jobs() if isinstance(cases[index], FaultCase)}
    assert seen == set(PHASES)
    assert len(jobs()) > 300


@pytest.mark.parametrize("row", QUICK)
def test_a_case_passes_and_fails_with_its_detector_switched_off(row):
    job = first(row, QUICK[row], "descent")
    outcome = run(job)
    assert outcome.passed, outcome
    off = run(job, row)
    assert not off.passed
    assert off.noticed_s is None


@pytest.mark.parametrize("row", SHOWN)
def test_a_show_passes_and_fails_without_what_notices_it(row):
    job = first(row)
    assert run(job).passed
    assert not run(job, row).passed


@pytest.mark.parametrize(
    ("change", "passed"),
    [
        ({}, True), ({"noticed_s": 0.54}, True), ({"noticed_s": 0.55}, False), ({"noticed_s": None}, False),
        ({"noticed_s": -0.1}, False), ({"reaction": "WARN"}, False), ({"ended": "lost"}, False),
        ({"ended": "safe"}, True), ({"ended": "never begun"}, False),
    ],
)  # fmt: skip
def test_what_counts_as_passed(change, passed):
    outcome = {"row": 2, "case": "x", "phase": "descent", "noticed_s": 0.5, "allowed_s": 0.5, "reaction": "ABORT",
               "expected": "ABORT", "ended": "surfaced", **change}  # fmt: skip
    one = FaultOutcome(**outcome)
    assert one.passed == passed
    found = summary([one, FaultOutcome(**{**outcome, "noticed_s": 0.1, "reaction": "ABORT", "ended": "surfaced"})])
    assert (found["passed"], found["failed"]) == ((1, 0) if passed else (0, 1))
    assert found["neither_surfaced_nor_safe"] == (change.get("ended", "surfaced") not in ("surfaced", "safe"))
    assert found["faults"][0]["number"] == 2


def test_a_vehicle_that_stays_below_is_called_lost():
    """Pump and out-of-band process fail, and nobody lets the weight go."""
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from glider.tools.verify.faults.flights import pump_fails_in_abort
    from glider.tools.verify.faults.scene import Setting, build_scene, fly

    with TemporaryDirectory() as folder:
        scene = build_scene("descent", pump_fails_in_abort("stuck"), Setting(), 1, Path(folder, "m.toml"))
        scene.board.drop_weight = None
        assert fly(scene, 18, allowed_s=30.0).ended == "lost"


def test_the_command_line(monkeypatch):
    from glider.tools.verify.faults.command import faults

    def here(only, disabled, workers, advance):
        return [run(job, disabled) for job in jobs(only)[:2]]

    monkeypatch.setattr(campaign, "run_all", here)
    done = CliRunner().invoke(faults, ["--only", "30", "--json"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert (result["passed"], result["failed"]) == (1, 0)
    row = result["faults"][0]
    fields = {"number", "name", "noticed_s", "allowed_s", "reaction", "expected", "ended", "pass"}
    assert fields <= set(row)
    done = CliRunner().invoke(faults, ["--only", "30", "--disable-detector", "30"])
    assert done.exit_code == 1
    assert "FAIL 30" in done.stdout
    assert CliRunner().invoke(faults, ["--only", str(max(FAULTS) + 1)]).exit_code == 2
