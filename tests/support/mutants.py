"""`python -m tests.support.mutants FOLDER`: mutants of the supervisor's and limits' code, by mutmut: do tests notice?

mutmut leaves decorated functions alone, and a compiled kernel shows it nothing: the copy that it works on has no
`@kernel`, which is what GLIDER_JIT=0 makes of it anyway. Needs `pip install mutmut`; takes some minutes.
"""

import json
import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[2]
MUTATED = (
    "hal/sortie.py", "firmware/core/supervision/surface.py",
    "firmware/core/supervision/supervisor.py", "firmware/core/supervision/detectors.py",
    "firmware/core/supervision/screening.py",
    "firmware/core/vehicle/actuators.py", "firmware/model/supervisor_settings.py",
)  # fmt: skip
PARTS = (
    "firmware",
    "hal",
    "sim_backend",
    "tools",
    "tests/support",
    "tests/unit/supervisor",
    "tests/unit/hal/test_sortie.py",
    "docs/explanation/supervisor.md",
    "tests/conftest.py",
)
# It reads the kernels' source, where mutmut puts calls of its own.
SOURCE_TEST = "tests/unit/supervisor/test_reactions.py::test_kernels_request_every_level_of_the_table_and_no_other"
CONFIG = """
[tool.mutmut]
source_paths = {mutated}
also_copy = ["firmware", "hal", "sim_backend", "tools", "tests", "docs"]
pytest_add_cli_args_test_selection = ["tests/unit/supervisor", "tests/unit/hal/test_sortie.py"]
pytest_add_cli_args = ["--deselect", "{source}"]
max_children = {children}

[tool.pytest.ini_options]
addopts = "-q -p no:cacheprovider"
"""


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--children", default=2, show_default=True, help="Processes at once.")
@click.option("--sample", type=click.IntRange(1), help="So many mutants, drawn at random, instead of all.")
@click.option("--seed", default=1, show_default=True, help="Of the sample.")
def main(folder: Path, children: int, sample: int | None, seed: int) -> None:
    """Make a copy in FOLDER, which is emptied, and try mutants of supervisor and limits on their tests."""
    shutil.rmtree(folder, ignore_errors=True)
    for part in PARTS:
        target = folder / part
        target.parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / part, target)
    for name in MUTATED:
        path = folder / name
        path.write_text(re.sub(r"^@kernel\n", "", path.read_text(), flags=re.MULTILINE))
    (folder / "pyproject.toml").write_text(CONFIG.format(mutated=list(MUTATED), children=children, source=SOURCE_TEST))
    environment = {**os.environ, "GLIDER_JIT": "0", "PYTHONPATH": ""}
    command = [sys.executable, "-m", "mutmut"]
    chosen: list[str] = []
    if sample is not None:
        subprocess.run([*command, "run", "none.of.them"], cwd=folder, env=environment, check=False, capture_output=True)
        names = sorted(name for meta in metas(folder) for name in meta)
        chosen = random.Random(seed).sample(names, min(sample, len(names)))
        click.echo(f"{len(chosen)} of {len(names)} mutants")
    subprocess.run([*command, "run", *chosen], cwd=folder, env=environment, check=False)
    codes = [code for meta in metas(folder) for code in meta.values() if code is not None]
    killed = sum(code != 0 for code in codes)
    click.echo(f"{killed} of {len(codes)} killed, {100 * killed / max(len(codes), 1):.1f} %")
    subprocess.run([*command, "results"], cwd=folder, env=environment, check=False)


def metas(folder: Path) -> list[dict[str, int | None]]:
    """What mutmut knows of each file's mutants: name -> exit code of the tests, None: not tried."""
    files = sorted((folder / "mutants").rglob("*.meta"))
    return [json.loads(path.read_text())["exit_code_by_key"] for path in files]


if __name__ == "__main__":
    main()
