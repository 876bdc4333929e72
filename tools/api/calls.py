"""Functions of the API. Each takes a case as a folder, as `Case` or as the tools' own; none prints, none exits."""

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Literal, ParamSpec, TypeVar

from glider.hal.strict import ConfigError
from glider.tools.api.recordings import Case, Log, Run, case_of, case_of_logs
from glider.tools.api.result import frozen
from glider.tools.api.results import Diagnosis, EffectTable, Gap, Identification, Readings, VehicleTable, Watch
from glider.tools.data.errors import InputError, need
from glider.tools.data.runs import case as cases
from glider.tools.data.vehicle_kinds import kind_of, kinds, no_progress

Progress = Callable[[str], None]
AnyCase = Case | cases.Case | Path | str
Effects = Mapping[str, Mapping[str, float] | None] | Iterable[str] | None
P = ParamSpec("P")
T = TypeVar("T")


def one_error(function: Callable[P, T]) -> Callable[P, T]:
    """Raise InputError for every mistake of a caller's, also for one that a file's reader calls ConfigError."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except ConfigError as error:
            raise InputError(str(error)) from error

    return call


def _say(progress: Progress | None) -> Progress:
    return (lambda text: None) if progress is None else progress


def _loaded(case: AnyCase, leave_out: bool = False) -> cases.Case:
    """The tools' own case."""
    if isinstance(case, Case):
        return case._case
    return case if isinstance(case, cases.Case) else cases.load_case(case, leave_out=leave_out)


@one_error
def load_case(folder: Path | str, vehicle: str | None = None) -> Case:
    """Read a case: a folder of run data (docs/reference/runs.md).

    Parameters
    ----------
    folder : path
        Folder with `case.toml` and the runs.
    vehicle : str, optional
        Shipped vehicle or vehicle file in place of the case's own.

    Returns
    -------
    Case

    Raises
    ------
    InputError
        If a file is missing or cannot be used; the message names file, line and column.

    Examples
    --------
    >>> import glider
    >>> glider.load_case("no-such-folder")
    Traceback (most recent call last):
        ...
    glider.tools.data.errors.InputError: no-such-folder: no such folder
    """
    return case_of(cases.load_case(folder, vehicle))


@one_error
def simulate(
    missions: str | Sequence[str] = "sawtooth",
    *,
    vehicle: str = "roughie",
    effects: Effects = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Case:
    """Fly missions on the simulated board, as `glider fly` does, and return the logs as a case.

    Parameters
    ----------
    missions : str or sequence of str
        Missions, by shipped name or file; one run each.
    vehicle : str
        Vehicle, by shipped name or file.
    effects : mapping or iterable of str, optional
        Effects of the plant that the vehicle file does not know: label to values of its parameters (None: 1 sigma of
        its prior), or labels, or `label:parameter=value` as at the command line.
    seed : int
        Seed of everything random in the first run, at least 0; run n has `seed + n`.
    progress : callable, optional
        Called with a line of text before each flight.

    Returns
    -------
    Case
        A run for each mission, at the rate of the board. `notes` names flights that did not complete.

    Raises
    ------
    InputError
        If a mission, vehicle or effect is unknown or cannot be used.

    Examples
    --------
    >>> import glider
    >>> case = glider.simulate("spiral", effects=["drag:scale=0.3"], seed=3)
    >>> case.vehicle, len(case)
    ('roughie', 1)
    """
    from glider.tools.data.log.parts import read_flight
    from glider.tools.flight.compose import build_flight, build_recorder
    from glider.tools.flight.precompile import FLIGHT, ensure_compiled
    from glider.tools.flight.sortie import SimulatedHost, fly

    say, wanted = _say(progress), _effects(effects)
    listed = [missions] if isinstance(missions, str) else list(missions)
    if not listed:
        raise InputError("no mission to fly", source="missions")
    if seed < 0:
        raise InputError(f"expected a number of at least 0, got {seed}", source="seed")
    ensure_compiled(FLIGHT, say, no_progress)
    logs, notes = [], []
    with TemporaryDirectory(prefix="glider-") as folder:
        for n, mission in enumerate(listed):
            say(f"flying {mission}, seed {seed + n}")
            flight = build_flight(mission=mission, vehicle=vehicle, seed=seed + n, effects=wanted)
            path = Path(folder) / f"{flight.mission.name}-{n:03d}.mcap"
            host = SimulatedHost(flight, name=path.stem, paced=False)
            recorder = functools.partial(build_recorder, flight, path, seed=seed + n, effects=wanted)
            fly(flight, host, recorder, log=path)
            if flight.autopilot.mode != "completed":
                notes.append(f"run{n:02d}: {mission} not completed: {flight.autopilot.reason}")
            logs.append(read_flight(path))
        return case_of_logs(logs, notes=notes)


def _effects(effects: Effects) -> dict[str, dict[str, float]]:
    """Effects as the plant takes them; InputError for one that is not in the catalogue or out of range."""
    from glider.sim_backend.core.effects.base import EffectError
    from glider.sim_backend.core.effects.catalogue import catalogue, check_flown
    from glider.tools.flight.compose import parse_effects

    if effects is None:
        return {}
    if isinstance(effects, str):
        effects = [effects]
    if not isinstance(effects, Mapping):
        return parse_effects(tuple(effects))
    found = {}
    for label, values in effects.items():
        known = catalogue().get(label)
        try:
            given = known.usual if values is None and known is not None else dict(values or {})
            found[label] = check_flown(label, given)
        except EffectError as error:
            raise InputError(str(error), source="effects") from None
    return found


@one_error
def measure_gap(case: AnyCase, model: str = "nominal", progress: Progress | None = None) -> Gap:
    """Measure the gap between the runs of a case and a model's predictions of them.

    Parameters
    ----------
    case : Case or path
        Runs.
    model : str
        `nominal` (the case's vehicle), a vehicle, or a corrected model's file.
    progress : callable, optional
        Called with lines of text on the way.

    Returns
    -------
    Gap
        Root mean square errors in tolerances, by run and channel, and their share by part of the model.

    Raises
    ------
    InputError
        If no sample can be scored, or the model cannot be used.
    MissingExtra
        If the extra `analysis` is not installed.

    Examples
    --------
    >>> import glider
    >>> gap = glider.measure_gap(glider.simulate("spiral", seed=1))
    >>> 0.0 < gap.total < 1.0
    True
    """
    from glider.tools.gap.assess import assess
    from glider.tools.inference.load import load_model

    need("analysis")
    loaded = _loaded(case)
    kind_of(loaded.vehicle).compile(_say(progress))
    return Gap(assess(loaded, load_model(model, loaded)))


@one_error
def readings(case: AnyCase) -> Readings:
    """Compare the readings of a case with each other, without a vehicle file.

    Parameters
    ----------
    case : Case or path
        Runs of a pool vehicle.

    Returns
    -------
    Readings
        Findings, each with size, 90 % interval and unit.

    Raises
    ------
    InputError
        If there is nothing to compare, or the vehicle is an ocean glider.
    MissingExtra
        If the extra `analysis` is not installed.

    Examples
    --------
    >>> import glider
    >>> found = glider.readings(glider.simulate("spiral", seed=1))
    >>> print(found.summary())  # doctest: +ELLIPSIS
    not_flying run00: afloat at the end for ...
    """
    need("analysis")
    loaded = _loaded(case)
    return Readings(kind_of(loaded.vehicle).readings(loaded))


@one_error
def identify(
    case: AnyCase,
    *,
    seed: int = 1,
    likelihood: Literal["flights", "accelerations"] = "flights",
    progress: Progress | None = None,
) -> Identification:
    """Identify the vehicle of a case from its runs.

    Parameters
    ----------
    case : Case or path
        Runs; those that cannot be fitted are named in `notes` and left out.
    seed : int
        Seed of the chains.
    likelihood : {'flights', 'accelerations'}
        What the coefficients are fitted to (docs/explanation/identification.md); of an ocean glider ignored.
    progress : callable, optional
        Called with lines of text on the way.

    Returns
    -------
    Identification
        Means, standard deviations and 90 % intervals of the parameters, and the vehicle file.

    Raises
    ------
    InputError
        If no run can be fitted.
    MissingExtra
        If the extra `identify` (of an ocean glider: `analysis`) is not installed.
    """
    loaded = _loaded(case, leave_out=True)
    return Identification(kind_of(loaded.vehicle).identify(loaded, seed, likelihood, _say(progress)))


@one_error
def diagnose(
    case: AnyCase,
    *,
    reference: AnyCase | None = None,
    without: str | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find where the simulator is wrong about a case, which effect causes it, and how far the gap shrinks with it.

    Parameters
    ----------
    case : Case or path
        Runs.
    reference : Case or path, optional
        Healthy runs of the same vehicle: what its model leaves there is no cause.
    without : str, optional
        Part of the method to leave out, as `glider gap diagnose --without` has it (docs/explanation/diagnosis.md).
    progress : callable, optional
        Called with lines of text on the way.

    Returns
    -------
    Diagnosis
        Verdict, probability of every cause, sizes with 90 % intervals, gap before and after.

    Raises
    ------
    InputError
        If the runs cannot be diagnosed, or a reference is given for an ocean glider.
    MissingExtra
        If the extra `analysis` is not installed.
    """
    import json

    need("analysis")
    from glider.tools.diagnose.record import ANSWER

    loaded = _loaded(case)
    healthy = None if reference is None else _loaded(reference)
    write = kind_of(loaded.vehicle).diagnose(loaded, healthy, without, _say(progress))
    with TemporaryDirectory(prefix="glider-") as folder:
        out = Path(folder)
        sentence = write(out)
        files = {path.name: path.read_bytes() for path in sorted(out.iterdir(), key=lambda one: one.stat().st_mtime_ns)}
    return Diagnosis(frozen(json.loads(files[ANSWER])), sentence, MappingProxyType(files))


@one_error
def watch(case: AnyCase, *, reference: AnyCase | None = None, progress: Progress | None = None) -> Watch:
    """Find what changed over the runs of a case, in their order: in which run, why, and how much.

    Parameters
    ----------
    case : Case or path
        Runs in their order.
    reference : Case or path, optional
        Runs of the same vehicle before anything changed. Default: the first runs of the case.
    progress : callable, optional
        Called with lines of text on the way.

    Returns
    -------
    Watch
        A verdict for every run, and the changes with size and 90 % interval.

    Raises
    ------
    InputError
        If there is nothing to compare the runs with.
    MissingExtra
        If the extra `analysis` is not installed.
    """
    from dataclasses import replace

    need("analysis")
    from glider.tools.data.runs.origin import flights_of
    from glider.tools.watch.watch import watch as watch_runs

    loaded = _loaded(case)
    found = watch_runs(loaded, None if reference is None else _loaded(reference), _say(progress))
    return Watch(replace(found, flights=flights_of(loaded.runs)))


@one_error
def read_log(file: Path | str) -> Log:
    """Read an onboard log (MCAP), complete or cut.

    Parameters
    ----------
    file : path
        The log; parts that it goes on in are read too.

    Returns
    -------
    Log

    Raises
    ------
    InputError
        If the file is not a log, or holds no record.
    """
    from glider.tools.data.log.parts import read_flight
    from glider.tools.data.log.rundata import run_of

    log = read_flight(file)
    exported = run_of(log)
    return Log(log, Run(exported.run), tuple(exported.notes))


@one_error
def effects(*labels: str) -> EffectTable:
    """List the effects that a simulated vehicle can have and a diagnosis can find.

    Parameters
    ----------
    *labels : str
        Labels of effects. Default: all.

    Returns
    -------
    EffectTable

    Raises
    ------
    InputError
        If a label is not in the catalogue.

    Examples
    --------
    >>> import glider
    >>> print(glider.effects("drag").summary())  # doctest: +ELLIPSIS
    drag  ...
    >>> len(glider.effects()) > 40
    True
    """
    from glider.sim_backend.core.effects.catalogue import catalogue

    known = catalogue()
    for label in labels:
        if label not in known:
            raise InputError(f"no effect '{label}'; glider effects lists them", source="effects")
    return EffectTable(tuple(known[label] for label in labels or known))


def vehicles() -> VehicleTable:
    """List the shipped vehicles.

    Returns
    -------
    VehicleTable

    Examples
    --------
    >>> import glider
    >>> "roughie" in glider.vehicles().names
    True
    """
    return VehicleTable(frozen({name: kind.group for kind in kinds().values() for name in kind.shipped()}))
