"""Which runs can be judged at all, and which part of them: a vehicle that does not fly says nothing about itself."""

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import recorded
from glider.tools.inference.ocean_inputs import missing_input, steady_seconds
from glider.tools.inference.ocean_inputs import states as dive_states
from glider.tools.readings.stretches import flying, states

SHORTEST_DIVE = 300.0  # s of an ocean glider's steady flight: as long as vertical water remembers itself
SHORTEST = 15.0  # s of flight; the filter needs some seconds to find how a run began
READ = 0.2  # of the rows that at least have a reading of the attitude
ASKED = (*names.ATTITUDE, *names.RATES, names.DEPTH)


def usable(run: Run, wanted: Set[str] = frozenset()) -> Run | str:
    """The run's longest stretch of flight, or why it cannot be judged. wanted: readings that other runs have."""
    if run.rows < 2:
        return "no two samples"
    there = {name for name in ASKED if recorded(run, name)}
    if len(there) < 2:
        return f"no readings but {', '.join(sorted(there)) or 'time'}"
    missing = sorted(name for name in wanted if not recorded(run, name))
    if missing:
        return f"no readings of {', '.join(missing)}, which the other runs have"
    attitude = [np.isfinite(run.columns[name]) for name in names.ATTITUDE if name in there]
    if attitude and np.mean(np.any(attitude, axis=0)) < READ:
        return "hardly a reading of the attitude"
    state = flying(run)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], state.astype(int), [0]])))
    stretches = sorted(zip(edges[::2], edges[1::2], strict=True), key=lambda one: run.t[one[0]] - run.t[one[1] - 1])
    length = float(run.t[stretches[0][1] - 1] - run.t[stretches[0][0]]) if stretches else 0.0
    if length < SHORTEST:
        reasons = [reason for reason, when in states(run).items() if when.any()]
        whole = float(run.t[-1] - run.t[0])
        if not reasons:
            return f"{whole:.0f} s long: {SHORTEST:.0f} s at least can be judged"
        return f"flies for {length:.0f} s of {whole:.0f} s only: {', '.join(reasons)}"
    first, end = stretches[0]
    if first == 0 and end == run.rows:
        return run
    columns = {name: values[first:end] for name, values in run.columns.items()}
    return replace(run, columns=columns, extra={})


def usable_dive(run: Run) -> Run | str:
    """The same of an ocean glider's run: it has to fly steadily for a while."""
    if run.rows < 2:
        return "no two samples"
    missing = missing_input(run)
    if missing is not None:
        return f"no readings of {missing}"
    steady, whole = steady_seconds(run), float(run.t[-1] - run.t[0])
    if steady >= SHORTEST_DIVE:
        return run
    found = sorted(((float(state.mean()), why) for why, state in dive_states(run).items()), reverse=True)
    listed = ", ".join(f"{why} {100.0 * share:.0f} %" for share, why in found[:2] if share > 0.05)
    return f"flies steadily for {steady:.0f} s of {whole:.0f} s only: {listed or 'short stretches'}"


def usable_flights(runs: Sequence[Run]) -> tuple[dict[int, Run], dict[int, str]]:
    """The runs that can be judged by their number, with the readings that most have, and why the others cannot."""
    found = {n: usable(run) for n, run in enumerate(runs)}
    good = {n: one for n, one in found.items() if isinstance(one, Run)}
    wanted = usual_readings(list(good.values()))
    return _judged(found | {n: usable(runs[n], wanted) for n in good})


def usable_dives(runs: Sequence[Run]) -> tuple[dict[int, Run], dict[int, str]]:
    """The same of an ocean glider's dives."""
    return _judged({n: usable_dive(run) for n, run in enumerate(runs)})


def _judged(found: dict[int, Run | str]) -> tuple[dict[int, Run], dict[int, str]]:
    return (
        {n: one for n, one in found.items() if isinstance(one, Run)},
        {n: one for n, one in found.items() if isinstance(one, str)},
    )


def readings_of(runs: list[Run]) -> set[str]:
    """The readings that every one of the runs has."""
    found = [{name for name in ASKED if recorded(run, name)} for run in runs]
    return set.intersection(*found) if found else set()


def usual_readings(runs: list[Run]) -> set[str]:
    """The readings that more than half of the runs have."""
    each = [readings_of([run]) for run in runs]
    return {name for name in ASKED if sum(name in own for own in each) > 0.5 * len(each)}
