"""C programs to be measured beside, compiled for this machine while they are needed."""

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from glider.tools.data.errors import InputError

FLAGS = ("-O3", "-march=native")


@contextmanager
def compiled(source: Path, compiler: str, *more: str) -> Iterator[Path]:
    """The program made from a C file, for as long as it is needed. InputError with the compiler's first complaint."""
    with tempfile.TemporaryDirectory(prefix="glider-c-") as folder:
        program = Path(folder) / source.stem
        command = [compiler, *FLAGS, *more, str(source), "-lm", "-o", str(program)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            complaints = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
            raise InputError(f"does not compile: {complaints[0] if complaints else done.returncode}", source=source)
        yield program
