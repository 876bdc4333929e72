"""A diagnosis in plain words: the verdict as one sentence, what is left, and numbers with units that a person reads."""

import math
import tomllib
from importlib.resources import files
from typing import Any

from glider.sim_backend.core.effects.base import Effect
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.cautions import ASSUMED_NUMBERS
from glider.tools.diagnose.noise_probes import CLOCK, TURBULENCE, UNPREDICTABLE
from glider.tools.diagnose.record import DiagnosisRecord, EstimateRecord, FindingRecord, Gap, Interval
from glider.tools.diagnose.record import number as finite
from glider.tools.diagnose.residuals import SHAPES, strongest_left
from glider.tools.inference.hyperparameters import DIAGNOSIS

MINUS, DASH = "\N{MINUS SIGN}", "\N{EN DASH}"
_WORDS = tomllib.loads(files(__package__).joinpath("words.toml").read_text(encoding="utf-8"))
PLAIN, CHANNEL_WORDS, AXES, FEATURES = (_WORDS[table] for table in ("effects", "channels", "axes", "features"))
SHOWN_AS_ZERO, SHOWN_AS_POWER = 1e-12, 1e-4  # shown as 0, and by a power of ten
# Below the first the next answer is named, unless it is below the second.
SURE_PROBABILITY, LITTLE_PROBABILITY = 0.8, 0.02
FACTORS = {"1 + {}": lambda value: 1.0 + value, "e^{}": math.exp}  # of rows of the catalogue, by their parameter's name
MEANS = {"none": "no gap", "unknown": "a gap of another kind"}
READABLE = {"rad": ("deg", 180.0 / math.pi), "rad/s": ("deg/s", 180.0 / math.pi), "1/rad": ("1/deg", math.pi / 180.0)}


def number(value: float) -> str:
    """Three digits that count, with a true minus; a power of ten where they stand far behind the point."""
    if not math.isfinite(value):
        return DASH
    if abs(value) <= SHOWN_AS_ZERO:
        return "0"
    if abs(value) < SHOWN_AS_POWER:
        digits, power = f"{value:.2e}".split("e")
        return f"{digits}e{int(power)}".replace("-", MINUS)
    places = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{places}f}".replace("-", MINUS)


def percent(share: float) -> str:
    """A share as whole percent, with a true minus."""
    return f"{100.0 * share:.0f}".replace("-0", "0").replace("-", MINUS) + " %" if math.isfinite(share) else "unknown"


def sure(p: float) -> str:
    """A probability in words; never certain."""
    if p >= 0.995:
        return "more than 99 %"
    return "less than 1 %" if p < 0.005 else f"{100.0 * p:.0f} %"


def small_percent(p: float) -> str:
    """A probability with one decimal; neither 0 nor 1."""
    return "< 0.1 %" if p < 0.0005 else "> 99.9 %" if p > 0.9995 else f"{100.0 * p:.1f} %"


def nats(value: float) -> str:
    return "more than 1000 nat" if value > 1000.0 else f"{value:.0f} nat"


def scaled(values: list[float], unit: str, mass: bool = True) -> tuple[list[float], str]:
    """SI values in the unit that is easiest to read; a trim's kg is no mass (N m over m2/s2) and stays."""
    if unit in READABLE:
        shown, factor = READABLE[unit]
        return [factor * value for value in values], shown
    largest = max(abs(value) for value in values)
    if mass and unit.startswith("kg") and largest < 1.0:
        return [1000.0 * value for value in values], unit[1:]
    if unit == "m" and largest < 0.1:
        return [1000.0 * value for value in values], "mm"
    return values, "" if unit == "1" else unit


def quantity(value: float, unit: str) -> str:
    """A number with its unit, the one that is easiest to read."""
    values, shown = scaled([value], unit)
    return f"{number(values[0])} {shown}".strip()


def place(label: str) -> str:
    """`subsystem: element` of a label."""
    effect = catalogue()[label]
    return f"{effect.subsystem}: {effect.element}"


def joined(parts: list[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def channel(name: str) -> str:
    return CHANNEL_WORDS.get(name, name)


def left_of(before: float, after: float) -> float:
    """Shrinkage, NaN where there was no gap."""
    return 1.0 - after / before if before > 0.0 else math.nan


def named(record: DiagnosisRecord, label: str) -> str:
    """An effect in plain words, with its sign, label, place and size; the bracket is left open."""
    size = size_of(catalogue()[label], record.answer.cause(label).parameters)
    return f"{directed(record, label)} ({label}, {place(label)}{f'; {size}' if size else ''}"


def directed(record: DiagnosisRecord, label: str) -> str:
    """Plain words of an effect of a diagnosis, with its sign."""
    return with_sign(label, record.answer.cause(label).parameters)


def with_sign(label: str, parameters: dict[str, EstimateRecord]) -> str:
    """Plain words of an effect: `more or less` is more, or less, where all parameters that are sure have one sign."""
    known = [one for one in parameters.values() if one.estimate is not None]
    signs = {math.copysign(1.0, finite(one.estimate)) for one in (clear(known) or known)}
    word = " more or less" if len(signs) != 1 else " more" if signs == {1.0} else " less"
    return PLAIN.get(label, label).replace(" more or less", word)


def clear(parameters: list[EstimateRecord]) -> list[EstimateRecord]:
    """Parameters whose 90 % interval leaves out 0."""
    return [one for one in parameters if finite(one.ci90[0]) > 0.0 or finite(one.ci90[1]) < 0.0]


def size_of(effect: Effect, parameters: dict[str, EstimateRecord]) -> str:
    """An effect's size: the quantity that its row of the catalogue multiplies, or parameters with their units.

    Only parameters that are sure, unless none is; "" where nothing was estimated.
    """
    known = {name: one for name, one in parameters.items() if one.estimate is not None}
    certain = clear(list(known.values())) or list(known.values())
    said = [_size(effect, name, one) for name, one in known.items() if any(one is sure_one for sure_one in certain)]
    signs = [clause for clause in effect.summary.split(", ") if clause.endswith("positive")] if said else []
    return ", ".join(["; ".join(said), *signs])


def _size(effect: Effect, name: str, one: EstimateRecord) -> str:
    """A parameter's size, by the clause of the effect's row that multiplies something by it, where one does."""
    for form, factor in FACTORS.items():
        written = form.format(name)
        clause = next((part for part in effect.summary.split(", ") if written in part), None)
        if clause is None:
            continue
        low, high = (factor(finite(end)) for end in one.ci90)
        times = sized(EstimateRecord(factor(finite(one.estimate)), (low, high), "1"))
        head = clause[: clause.index("1 + " if form.startswith("1") else written)]
        if "(" in head:
            return f"{name} by a factor of {times}"
        return f"{f'{name}: ' if clause.count('1 + ') > 1 else ''}{head}{times}"
    return f"{name} {sized(one, effect.subsystem in ('mass', 'actuation'))}"


def sized(one: EstimateRecord, mass: bool = True) -> str:
    """An estimate in the unit that is easiest to read, with its 90 % interval where there is one."""
    ends = [finite(end) for end in one.ci90]
    whole = all(map(math.isfinite, ends))
    values, unit = scaled([finite(one.estimate), *(ends if whole else [])], one.unit, mass)
    shown = [number(value) for value in values]
    return f"{shown[0]}{f' {unit}' if unit else ''}" + (f", 90 %: {shown[1]} to {shown[2]}" if whole else "")


def change(share: float) -> str:
    """`shrinks by 12 %` or, where it does not, `grows by 3 %`."""
    return f"grows by {percent(-share)}" if share < -0.005 else f"shrinks by {percent(max(share, 0.0))}"


def interval_of(low: float, high: float) -> str:
    """A 90 % interval of a number; nothing where there is none."""
    return f"90 %: {number(low)} to {number(high)}" if math.isfinite(low) and math.isfinite(high) else ""


def interval(low: float, high: float) -> str:
    """A 90 % interval of a share."""
    return f"90 % interval {percent(low).removesuffix(' %')} to {percent(high)}"


def which(record: DiagnosisRecord) -> str:
    """The runs that figures are of: of a single run nothing can be left out."""
    return "on runs left out of the fit" if record.details.data.runs > 1 else "of this run, to which all was fitted,"


def how_far(record: DiagnosisRecord, with_what: str) -> str:
    """How far the gap shrinks, with the interval where there is one, and what recalibration alone does."""
    gap = record.answer.gap
    share = left_of(finite(gap.before["total"]), finite(gap.after["total"]))
    return (
        f"{with_what} the gap {which(record)} {with_interval(change(share), gap.shrinkage)}, while refitting the "
        f"nominal parameters alone {alone(gap)}"
    )


def with_interval(said: str, share: Interval) -> str:
    """What is said of a share, with its 90 % interval where there is one."""
    low, high = map(finite, share.ci90)
    return f"{said} ({interval(low, high)})" if math.isfinite(low) and math.isfinite(high) else said


def blind(gap: Gap) -> bool:
    """Whether the floor itself is above one tolerance: then no gap may be said to be none."""
    return finite(gap.floor["total"]) > 1.0


def means(label: str, gap: Gap) -> str:
    """What `none` and `unknown` mean; "" for an effect."""
    return "no gap above the floor" if label == "none" and blind(gap) else MEANS.get(label, "")


def alone(gap: Gap) -> str:
    """What recalibration does to the gap, as the end of a sentence."""
    share = left_of(finite(gap.before["total"]), finite(gap.recalibrated["total"]))
    return f"makes it {percent(-share)} larger" if share < -0.005 else f"shrinks it by {percent(max(share, 0.0))}"


def how_sure(record: DiagnosisRecord) -> str:
    """`97 % sure`; where that is little, what else it may be."""
    first, second = record.answer.causes[:2]
    if first.probability >= SURE_PROBABILITY or second.probability < LITTLE_PROBABILITY:
        return f"{sure(first.probability)} sure"
    other = means(second.label, record.answer.gap) or second.label
    return f"only {sure(first.probability)} sure, else {other} at {sure(second.probability)}"


def sentence(record: DiagnosisRecord) -> str:
    """The verdict in one plain sentence: what, where, how sure, how far; first that a vehicle file is a guess."""
    answer = record.answer
    if answer.verdict == "none":
        said = _none(record)
    elif answer.verdict == "unknown":
        said = _unknown(record)
    else:
        said = _excess_noise(record) if answer.main in UNPREDICTABLE else _causes(record)
    return (
        f"Identify the vehicle first, its file has assumed numbers; as far as that file goes: {said}"
        if guessed(record)
        else said
    )


def guessed(record: DiagnosisRecord) -> bool:
    """Whether the vehicle file says of its own numbers that nobody measured them."""
    return any(line.startswith(ASSUMED_NUMBERS) for line in record.answer.cautions)


def _none(record: DiagnosisRecord) -> str:
    gap = record.answer.gap
    before, refitted, floor = (number(finite(table["total"])) for table in (gap.before, gap.recalibrated, gap.floor))
    certain = f"; certain by the readings alone: {joined(record.answer.selected)}" if record.answer.selected else ""
    if blind(gap):
        said = (
            f"A gap below {floor} tolerances cannot be seen in these runs: noise and disturbance alone leave as much. "
            f"Nothing stands out above that ({how_sure(record)})"
        )
    else:
        said = "No gap: noise, disturbance and parameters within their uncertainty explain these runs "
        said += f"({how_sure(record)})"
    return (
        f"{said}; the total {which(record)} is {before} tolerances with the nominal model and {refitted} with its "
        f"parameters refitted, where noise and disturbance alone leave {floor}{certain}."
    )


def _causes(record: DiagnosisRecord) -> str:
    answer = record.answer
    others = [label for label in answer.selected if label != answer.main]
    confounded = [label for label in answer.cause(answer.main).group if label != answer.main]
    said = f"{named(record, answer.main)}; {how_sure(record)})"
    if confounded:
        said += f", which these data cannot distinguish from {joined(confounded)}"
    if others:
        said += f", and also {joined([f'{named(record, label)})' for label in others])}"
    if record.details.noise is not None and record.details.noise.name == CLOCK:
        said += "; that clock's delay varies with time"
    head = {0: "", 1: "Two effects at once: "}.get(len(others), f"{len(others) + 1} effects at once: ")
    far = how_far(record, "with that in the model" if not others else "with these in the model")
    return f"{upper(head + said)}; {far}."


def _excess_noise(record: DiagnosisRecord) -> str:
    answer, noise = record.answer, record.details.noise
    size = ""
    if answer.main == TURBULENCE and noise is not None:
        size = f", about {noise.scale:.2g} times as rough"
    others = [label for label in answer.selected if label != answer.main]
    beside = f", and also {joined([f'{named(record, o)})' for o in others])}" if others else ""
    return (
        f"{upper(PLAIN[answer.main])}{size} ({answer.main}, {place(answer.main)}; {how_sure(record)}){beside}; its "
        f"time course is random, so that knowing it shrinks no gap. The gap {which(record)} is "
        f"{number(finite(answer.gap.before['total']))} tolerances, and refitting the nominal parameters "
        f"{alone(answer.gap)}, to {number(finite(answer.gap.recalibrated['total']))}."
    )


def _identified(record: DiagnosisRecord) -> str:
    """A vehicle that had to be identified: what is certain, how far it helps, what is left."""
    answer = record.answer
    first, last = (finite(answer.stages[n].gap["total"]) for n in (0, -1))
    certain = [f"{PLAIN[label]} ({label})" for label in answer.selected]
    unnamed = [one.text for one in answer.readings if one.label is None and one.finding == "goes_with"]
    said = "Certain: " + "; ".join(certain) if certain else "No effect of the catalogue is certain"
    said += (
        f". With {'that and ' if certain or unnamed else ''}the vehicle identified from these runs, the gap "
        f"{which(record)} is {number(last)} tolerances instead of {number(first)}. What is left has no cause with a "
        "name yet"
    )
    return f"{said}."


def _unknown(record: DiagnosisRecord) -> str:
    answer = record.answer
    if any(stage.stage == "identified" for stage in answer.stages):
        return _identified(record)
    said = f"A gap that no effect of the catalogue explains ({how_sure(record)})"
    strongest, correlated = strongest_left(record.details.findings)
    if strongest is not None:
        said += f", strongest in measured {channel(strongest.channel)}"
    if strongest is not None and correlated is not None:
        elsewhere = f", in measured {channel(correlated.channel)}," if correlated.channel != strongest.channel else ""
        said += f" and{elsewhere} correlated with {feature(correlated.test)}"
    if answer.where:
        likely = answer.where[0]
        said += f", most likely in {likely.subsystem}: {likely.element} ({sure(likely.probability)})"
    known = "with nothing added to the model"
    by_readings = {one.label for one in answer.readings} - {label for stage in answer.stages for label in stage.added}
    added = [label for label in answer.selected if label not in by_readings]
    if added:
        known = f"with the nearest known effects in the model ({joined(added)})"
    said += f"; {how_far(record, known)}"
    correction = None if answer.unknown is None else answer.unknown.correction
    if correction is not None:
        share = left_of(finite(answer.gap.before["total"]), finite(correction.gap["total"]))
        does = f"shrink it by {percent(max(share, 0.0))}" if share >= -0.005 else f"enlarge it by {percent(-share)}"
        features = joined([feature(name) for name in correction.goes_with])
        said += f"; a data-driven correction of the {correction.link}, a function of {features}, would {does}"
    return f"{said}."


def feature(name: str) -> str:
    """What a residual is correlated with, or a correction is a function of."""
    return FEATURES.get(name, name)


def finding(found: FindingRecord, rate_hz: float) -> str:
    """What a test says, after the channel's name."""
    if found.test == "variance":
        return "larger than noise and disturbance allow" if found.sigma > 0 else "smaller than expected"
    if found.test == "mean":
        return "biased in some runs"
    if found.test == "spectrum":
        return "periodic"
    if found.test.startswith("lag"):
        low, high = (f"{int(part) / rate_hz:.2g}" for part in found.test.split()[1].split("-"))
        return f"autocorrelated over {low} to {high} s"
    return f"correlated with {feature(found.test)}"


def described(record: DiagnosisRecord) -> list[dict[str, Any]]:
    """What is left by channel, strongest first: reading, channel, axis, its shape, its correlations, sigma."""
    rows: dict[str, dict[str, Any]] = {}
    for found in record.details.findings:
        if abs(found.sigma) < DIAGNOSIS.residual_sigma:
            continue
        empty = {
            "reading": found.channel, "channel": channel(found.channel), "axis": AXES.get(found.channel, ""),
            "sigma": 0.0, "shape": [], "correlated": [],
        }  # fmt: skip
        row = rows.setdefault(found.channel, empty)
        row["sigma"] = max(row["sigma"], float(abs(found.sigma)))
        text = f"{finding(found, record.details.data.log_rate_hz)} ({abs(found.sigma):.0f})"
        kind, most = ("shape", 1) if found.test.startswith(SHAPES) else ("correlated", 3)
        if len(row[kind]) < most:
            row[kind].append(text)
    return list(rows.values())
