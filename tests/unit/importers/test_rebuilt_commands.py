"""Commands that a log does not hold: of words for the drive's state, of on and off, of the reading alone."""

import re
from importlib.resources import files

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.tools.data.errors import InputError
from glider.tools.data.importers.csvlog import import_csv
from glider.tools.data.importers.mapping import decode_map
from glider.tools.data.runs.case import load_case

LOW, HIGH, RATE, HZ = -0.2, 0.2, 0.03, 20.0  # kg, kg/s; the log's rows a second
MAP = """\
format = 1
vehicle = "roughie"
water_density_kg_m3 = 998.0
{rate}
[time]
column = "s"
[columns.ballast_kg]
source = "tank"
unit = "g"
scale = 0.5
[commands.cmd_ballast_kg]
follows = "ballast_kg"
low = -0.2
high = 0.2
{rule}
"""
WORDS = """\
[commands.cmd_ballast_kg.to_low]
source = "state"
words = ["expel"]
[commands.cmd_ballast_kg.to_high]
source = "state"
words = ["take in", "fill"]
"""
ON_OFF = """\
[commands.cmd_ballast_kg.to_low]
source = "pump"
words = ["1"]
[commands.cmd_ballast_kg.to_high]
source = "valve"
words = ["1"]
"""


def log(folder, ends=None):
    """A pump that runs in at 5 s, out at 25 s, in at 45 s; `ends`: when the last run is stopped, s. What was sent."""
    t = np.round(np.arange(0.0, 70.0, 1.0 / HZ), 3)
    sent = np.select([t >= 45.0, t >= 25.0, t >= 5.0], [HIGH, LOW, HIGH], 0.0)
    place, state = np.empty(len(t)), []
    now = 0.0
    for n, goal in enumerate(sent):
        stopped = ends is not None and t[n] >= ends
        step = 0.0 if stopped else np.clip(goal - now, -RATE / HZ, RATE / HZ)
        place[n] = now = now + step
        state.append("fill" if step > 1e-9 else "expel" if step < -1e-9 else "idle")
    if ends is not None:
        sent[t >= ends] = place[t >= ends]
    rng = np.random.default_rng(4)
    counts = np.round(2000.0 * (place + 0.0005 * rng.standard_normal(len(t))))
    lines = ["s,tank,state,pump,valve"]
    for n, word in enumerate(state):
        lines.append(f"{t[n]},{counts[n]:.0f}, {word},{int(word == 'expel')},{int(word == 'fill')}")
    (folder / "a.csv").write_text("\n".join(lines))
    return t, sent


def bring(folder, rule, rate=""):
    (folder / "map.toml").write_text(MAP.format(rule=rule, rate=rate))
    imported = import_csv([folder / "a.csv"], str(folder / "map.toml"), folder / "out")
    return imported, load_case(folder / "out").runs[0]


@pytest.mark.parametrize(("rule", "apart"), [(WORDS, 0), (ON_OFF, 0), ("rate = 0.03", 2)])
def test_a_pump_that_runs_to_its_stops(tmp_path, rule, apart):
    """The command is the stop from the row on at which the pump starts; two rows beside it, seen by the reading."""
    t, sent = log(tmp_path)
    imported, run = bring(tmp_path, rule)
    command = run.columns["cmd_ballast_kg"]
    assert command[t < 4.9] == pytest.approx(0.0, abs=0.002)  # where it stood
    settled = np.minimum.reduce([np.abs(t - begin) for begin in (5.0, 25.0, 45.0)]) > (apart + 0.5) / HZ
    moving = settled & (t >= 5.0)
    np.testing.assert_array_equal(command[moving], sent[moving])
    assert "a.csv: cmd_ballast_kg: " in imported.notes[0]


@pytest.mark.parametrize("rule", [WORDS, ON_OFF, "rate = 0.03"])
def test_a_run_that_is_stopped_between(tmp_path, rule):
    t, sent = log(tmp_path, ends=50.0)
    imported, run = bring(tmp_path, rule)
    command = run.columns["cmd_ballast_kg"]
    assert command[(t > 45.2) & (t < 49.8)] == pytest.approx(HIGH)
    assert command[t > 50.2] == pytest.approx(sent[-1], abs=0.002)
    assert re.findall(r": (\d) .*, (\d) ", imported.notes[0]) == [("2", "1")]


def test_commands_are_in_force_from_their_row_also_at_another_rate(tmp_path):
    log(tmp_path)
    _, run = bring(tmp_path, WORDS, "rate_hz = 2.0")
    assert set(np.unique(run.columns["cmd_ballast_kg"][run.t >= 5.0])) == {LOW, HIGH}
    assert run.columns["cmd_ballast_kg"][run.t < 5.0] == pytest.approx(0.0, abs=0.002)


def test_the_pump_of_2015_ran_in_and_out_in_turn(shared, tmp_path):
    mapping = (files("glider.tools.data.importers") / "maps" / "roughie2015.toml").read_text()
    rule = 'follows = "ballast_kg"\nlow = -0.2\nhigh = 0.19\nrate = 0.015\n'
    (tmp_path / "map.toml").write_text(f"{mapping}\n[commands.cmd_ballast_kg]\n{rule}")
    raw = [shared / "data" / "roughie2015" / "raw" / f"flight{n}.csv.gz" for n in (1, 2)]
    import_csv(raw, str(tmp_path / "map.toml"), tmp_path / "out")
    for run, runs_of_the_pump in zip(load_case(tmp_path / "out").runs, (7, 8), strict=True):
        command, place = run.columns["cmd_ballast_kg"], run.columns["ballast_kg"]
        begun = [row for row in np.flatnonzero(np.diff(command)) + 1 if command[row] in (-0.2, 0.19)]
        assert command[begun].tolist() == (4 * [0.19, -0.2])[:runs_of_the_pump]
        ended = [row for row in np.flatnonzero(np.diff(command)) + 1 if row not in begun]
        assert len(ended) in (runs_of_the_pump - 1, runs_of_the_pump)  # the last may go on past the cut
        np.testing.assert_allclose(command[ended], place[ended], atol=0.003)


def test_words_for_a_command(tmp_path):
    (tmp_path / "a.csv").write_text("s,mode\n0,dive\n1,\n2,climb\n3, dive\n")
    text = MAP[: MAP.index("[columns")].format(rate="") + (
        '[columns.cmd_ballast_kg]\nsource = "mode"\nunit = "g"\nwords = {dive = 200, climb = -150}\n'
    )
    (tmp_path / "map.toml").write_text(text)
    import_csv([tmp_path / "a.csv"], str(tmp_path / "map.toml"), tmp_path / "out")
    found = load_case(tmp_path / "out").runs[0].columns["cmd_ballast_kg"]
    np.testing.assert_array_equal(found, [0.2, np.nan, -0.15, 0.2])
    (tmp_path / "a.csv").write_text("s,mode\n0,dive\n1,7\n")
    with pytest.raises(InputError, match=r"a.csv:3: mode: .*'7'"):
        import_csv([tmp_path / "a.csv"], str(tmp_path / "map.toml"), tmp_path / "other")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("high = 0.2", "high = -0.3", "commands.cmd_ballast_kg.high: "),
        ('follows = "ballast_kg"', 'follows = "slider_m"', "commands.cmd_ballast_kg.follows: .columns. has no"),
        ("[commands.cmd_ballast_kg]", "[commands.pump]", "commands.pump: "),
        ("rate = 0.03", "", "expected `to_low` and `to_high`"),
        ("rate = 0.03", "rate = 0.03\n" + WORDS, "expected `to_low` and `to_high`"),
        ("rate = 0.03", WORDS[: WORDS.index("[commands.cmd_ballast_kg.to_high")], "expected `to_low` and `to_high`"),
        ("rate = 0.03", "speed = 0.03", "commands.cmd_ballast_kg.speed: unknown key"),
    ],
)
def test_rules_are_strict(old, new, said):
    text = MAP.format(rule="rate = 0.03", rate="")
    assert old in text
    with pytest.raises(ConfigError, match=said):
        decode_map(text.replace(old, new), "map.toml")
