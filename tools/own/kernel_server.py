"""`python -m glider.tools.own.kernel_server VEHICLE`: kernels of a vehicle file's model for another process.

Calls are read from standard input, name and arguments (kernel_messages.py), and answered on standard output by what it
returned and what it wrote into its last argument, None twice where it raised; until the input ends.
"""

import os
import sys
from pathlib import Path

from glider.tools.own.kernel_messages import receive, send
from glider.tools.own.load import read_own


def serve(path: Path) -> None:
    """Answer calls; what the model prints is not among the answers."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    kernels = read_own(path).kernels
    while True:
        try:
            name, *given = receive(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer = getattr(kernels, name)(*given), given[-1]
        except Exception:  # raised again where it was asked
            answer = None, None
        send(answers, answer)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
