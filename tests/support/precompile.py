"""What several test files need and would each make for themselves: once, by processes of their own beside each other,
before the tests begin. Kernels that `make setup` does not compile, Hypothesis' table of all characters, and the test
files' bytecode, with their assertions as pytest writes them.

`python -m tests.support.precompile` is what `make test` runs; with a name of WORKS it does that alone. What was done
leaves its stamp in the cache of kernels, the characters their file in .hypothesis, the bytecode its own files, so that
the next call ends at once.
"""

import contextlib
import io
import subprocess
import sys
import tempfile
from pathlib import Path

from glider.firmware.core.jit import kernel_count
from glider.tools.flight.precompile import Work
from glider.tools.own.precompile import OBSERVER
from glider.tools.study.precompile import CAMPAIGN


def _identify_a_moment() -> None:
    """A vehicle identified from two short captured runs, by both likelihoods."""
    from glider.tools.data.runs.case import load_case, write_case
    from glider.tools.data.sources import load_vehicle
    from glider.tools.identify.design import CAPTURE, make_runs
    from glider.tools.identify.pipeline import ACCELERATIONS, identify

    with tempfile.TemporaryDirectory() as folder:
        runs, _ = make_runs(load_vehicle("roughie"), 6, [0, 6])
        about = dict(vehicle="roughie", site="pool", log_rate_hz=50.0, water_density_kg_m3=998.0, sensors=CAPTURE)
        write_case(Path(folder, "case"), runs, **about)
        identify(load_case(Path(folder, "case")), likelihood=ACCELERATIONS)


def _challenge_a_moment() -> None:
    """Blind tests of one case each, in the foreign plant: of the file's form and of another."""
    from glider.tools.verify.challenge.form_make import FormOrder
    from glider.tools.verify.challenge.form_plan import FormCounts
    from glider.tools.verify.challenge.make import Order, make
    from glider.tools.verify.challenge.plan import Counts

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        make(Order(out, 6, Counts(single=0, none=1, pairs=0, unknown=0), out / "answers.zip"), jobs=1)
        formed = FormCounts(changed=0, unchanged=1, outside=0, reference=2)
        make(FormOrder(out / "form", 6, formed, out / "form" / "answers.zip"), jobs=1)


def _glide_a_moment() -> None:
    """Four dives of an ocean glider: identified, measured, watched."""
    from glider.tools.gap.assess import assess
    from glider.tools.identify.ocean.identify import identify_ocean
    from tests.support.ocean import as_case, fly_dives

    with tempfile.TemporaryDirectory() as folder:
        case = as_case(Path(folder, "case"), fly_dives(4, speed=True).runs)
        identify_ocean(case)
        assess(case)


def _list_characters() -> None:
    """Which characters there are in a text: Hypothesis keeps them in a file, and takes four seconds to find them."""
    from hypothesis.strategies import text

    text().validate()


def _collect_tests() -> None:
    """The test files read as pytest reads them: otherwise each of its processes would rewrite all of them at once."""
    import pytest

    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main(["--collect-only", "-p", "no:cacheprovider"])


CHARACTERS, TESTS = "characters", "tests"
WORKS = (
    Work("identification", kernel_count, _identify_a_moment),
    Work("challenge", kernel_count, _challenge_a_moment),
    CAMPAIGN,
    Work("ocean", kernel_count, _glide_a_moment),
    OBSERVER,
)


def main(names: list[str]) -> int:
    """Exit code: 0, or that of the work that failed."""
    if names:
        for work in WORKS:
            if work.name in names:
                work.compile()
        if CHARACTERS in names:
            _list_characters()
        if TESTS in names:
            _collect_tests()
        return 0
    waiting = [work.name for work in WORKS if (stamp := work.stamp()) is not None and not stamp.exists()]
    if waiting:
        print(f"compiling kernels that tests share: {', '.join(waiting)}", flush=True)
    if not list(Path(".hypothesis").glob("unicode_data/*/codec-*")):
        waiting.append(CHARACTERS)
    if not list(Path("tests").glob("unit/**/__pycache__/*-pytest-*.pyc")):
        waiting.append(TESTS)
    started = [subprocess.Popen([sys.executable, "-m", "tests.support.precompile", name]) for name in waiting]
    return max((process.wait() for process in started), key=abs, default=0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
