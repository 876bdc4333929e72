"""`python -m glider.tools.own.kernel_server VEHICLE`: kernels of a vehicle file's model for another process.

Calls are pickled on standard input, [name, arguments], answers on standard output, [what it returned, what it wrote
into its last argument], None twice where it raised; until the input ends.
"""

import os
import pickle
import sys
from pathlib import Path

from glider.tools.own.load import read_own


def serve(path: Path) -> None:
    """Answer calls; what the model prints is not among the answers."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    kernels = read_own(path).kernels
    while True:
        try:
            name, given = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer = getattr(kernels, name)(*given), given[-1]
        except Exception:  # raised again where it was asked
            answer = None, None
        pickle.dump(answer, answers, pickle.HIGHEST_PROTOCOL)
        answers.flush()


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
