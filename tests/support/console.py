"""Console blocks of the documentation: run as a reader would, and compared with the output that the page shows.

A block is fenced as ```console; a line that begins with `$ ` is a command, the lines below it are its output. `...` in
the output stands for any text within a line, and on a line of its own for any lines. Numbers may differ by 2 %, since
kernels are compiled for the machine. Progress is not shown. A comment before the block says what is special:

    <!-- exit: 2 -->               the last command of the block ends with that code
    <!-- not run: needs hardware -->   the commands are checked against the command line, and not run

`python -m tests.support.console PAGE ...` runs pages and writes the output that they have now into them; without a page
it prints the hand-written words of every page.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
GENERATED = {"archive", "generated"}  # folders whose words are not counted
PAGES = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.md") if not GENERATED & set(p.parts))]
MOST_WORDS = 30_000
BLOCK = re.compile(r"((?:<!-- (?:exit|not run): [^\n]*-->\n+)*)```console\n(.*?)```", re.DOTALL)
PROGRESS = re.compile(
    r"^([\w' -]+: \d+/\d+(, \d+ s)?|compil\w+ .*|screened .*|best candidate .*|verdict: [^,]*|.*: \d+ of \d+ s)$"
)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
TOLERANCE = 0.02  # of a number: kernels are compiled for the machine


@dataclass(frozen=True)
class Block:
    """Commands with their shown output, the last one's exit code, and why the block is not run (empty: it is)."""

    commands: tuple[tuple[str, str], ...]
    code: int
    not_run: str


def blocks(text: str) -> list[Block]:
    """Read the console blocks of a page."""
    return [_block(match[1], match[2]) for match in BLOCK.finditer(text)]


def _block(comments: str, body: str) -> Block:
    code = re.search(r"<!-- exit: (\d+) -->", comments)
    not_run = re.search(r"<!-- not run: ([^\n]*?) -->", comments)
    commands: list[list[str]] = []
    for line in body.splitlines():
        if line.startswith("$ "):
            commands.append([line[2:], ""])
        elif commands and commands[-1][0].endswith("\\") and not commands[-1][1]:
            commands[-1][0] += "\n" + line
        elif commands:
            commands[-1][1] += line + "\n"
    return Block(tuple((c, o) for c, o in commands), int(code[1]) if code else 0, not_run[1] if not_run else "")


class Session:
    """A shell of the reader: one empty folder for a page, with `docs` of the clone beside it and `glider` in PATH."""

    def __init__(self, folder: Path):
        self.folder = folder / "walk"
        self.folder.mkdir()
        (folder / "docs").symlink_to(ROOT / "docs")
        programs = folder / "programs"
        programs.mkdir()
        (programs / "glider").write_text(f'#!/bin/sh\nexec {sys.executable} -m glider.tools.cli.main "$@"\n')
        (programs / "glider").chmod(0o755)
        self.environment = os.environ | {
            "PATH": f"{programs}:{Path(sys.executable).parent}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "COLUMNS": "100",
        }

    def run(self, command: str) -> tuple[int, str]:
        """Run one command; returns its exit code and what a reader sees, without progress."""
        done = subprocess.run(
            ["bash", "-c", command], cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=600
        )
        said = [line for line in done.stderr.splitlines() if not PROGRESS.match(line)]
        return done.returncode, "".join(f"{line}\n" for line in [*done.stdout.splitlines(), *said])


def differs(shown: str, output: str) -> str | None:
    """Compare the output with the page's; returns the first line of the page that does not fit, None where all do."""
    pattern, lines = shown.splitlines(), output.splitlines()
    return _differs(pattern, lines)


def _differs(pattern: list[str], lines: list[str]) -> str | None:
    for n, line in enumerate(pattern):
        if line.strip() == "...":
            rest = pattern[n + 1 :]
            tails = [_differs(rest, lines[k:]) for k in range(n, len(lines) + 1)]
            return None if None in tails else next((t for t in tails if t), line)
        if n >= len(lines) or not _same(line, lines[n]):
            return f"{line!r}, got {lines[n] if n < len(lines) else 'nothing'!r}"
    return None if len(lines) <= len(pattern) else f"end of output, got {lines[len(pattern)]!r}"


def _same(shown: str, line: str) -> bool:
    """Whether a line fits: words alike, numbers within the tolerance and half of their last digit."""
    shown, line = shown.rstrip(), line.rstrip()
    if "..." in shown:
        head, _, tail = shown.partition("...")
        middle = len(tail) - len(tail.lstrip(") "))  # behind a name of other length a column begins elsewhere
        return line.startswith(head) and _same(tail[middle:], line[-len(tail[middle:]) :] if tail[middle:] else "")
    if re.sub(r"\s+", " ", NUMBER.sub("#", shown)) != re.sub(r"\s+", " ", NUMBER.sub("#", line)):
        return False
    for a, b in zip(NUMBER.findall(shown), NUMBER.findall(line), strict=True):
        digit = 10.0 ** -len(a.partition(".")[2])
        if a != b and abs(float(a) - float(b)) > max(1.5 * digit, TOLERANCE * abs(float(a))) + 1e-9:
            return False
    return True


def run_page(page: Path, folder: Path) -> list[str]:
    """Run a page's blocks in order; returns what does not fit, one line each."""
    wrong = []
    session = Session(folder)
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.not_run:
            continue
        for n, (command, shown) in enumerate(block.commands, start=1):
            code, output = session.run(command)
            expected = block.code if n == len(block.commands) else 0
            if code != expected:
                wrong.append(f"$ {command}: exit code {code}\n{output}")
            elif fault := differs(shown, output):
                wrong.append(f"$ {command}: {fault}")
    return wrong


def rewrite(page: Path) -> None:
    """Write the present output into a page's blocks; output that fits with its `...` stays."""
    with tempfile.TemporaryDirectory() as folder:
        session = Session(Path(folder))

        def renewed(match: re.Match[str]) -> str:
            block = _block(match[1], match[2])
            if block.not_run:
                return match[0]
            text = ""
            for command, shown in block.commands:
                _, output = session.run(command)
                kept = shown if shown and differs(shown, output) is None else output
                text += f"$ {command}\n{kept}"
            return f"{match[1]}```console\n{text}```"

        page.write_text(BLOCK.sub(renewed, page.read_text(encoding="utf-8")), encoding="utf-8")


def glider_commands(command: str) -> list[list[str]]:
    """The words of each call of `glider` in a shell command, without redirections and comments."""
    found = []
    for part in re.split(r"&&|\|\||;|\||(?<!\d)>", re.sub(r"\s#.*", "", command.replace("\\\n", " "))):
        words = shlex.split(part)
        if words and Path(words[0]).name == "glider":
            found.append(words[1:])
    return found


def words_of(page: Path) -> int:
    """Count the hand-written words of a page: tokens that hold two letters, outside code and generated parts."""
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"<!-- generated .*?<!-- end -->", "", text, flags=re.DOTALL)
    text = re.sub(r"```.*?```|\$\$.*?\$\$|<!--.*?-->", "", text, flags=re.DOTALL)
    return len([token for token in text.split() if re.search(r"[A-Za-z]{2}", token)])


def main(pages: list[str]) -> None:
    """Renew the pages named; without any, count words."""
    if not pages:
        counted = {str(page.relative_to(ROOT)): words_of(page) for page in PAGES}
        print(*(f"{count:6d}  {page}" for page, count in sorted(counted.items(), key=lambda item: -item[1])), sep="\n")
        print(f"{sum(counted.values()):6d}  of {MOST_WORDS}")
    for page in pages:
        rewrite(Path(page))
        print(page)


if __name__ == "__main__":
    assert shutil.which("bash")
    main(sys.argv[1:])
