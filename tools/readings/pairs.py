"""Attitude, gyro and depth that disagree by a sign, a unit or an axis: which is wrong, by what else was recorded.

Every way in which one instrument alone could be wrong is a hypothesis: the angles or the rates of some axes turned, in
another unit, two of them exchanged. Its likelihood is a product of
- the rates against the attitude, all axes, both put right as the hypothesis says: a pitch that is turned spoils
  the body rates about the other axes too, as soon as the vehicle turns (and not, where only a rate is turned);
- the depth rate against the pitch: w = V sin(alpha - pitch), speed V and angle of attack alpha unknown in each block;
- motion capture's attitude against the onboard one and against the rates;
- the size of the rates.
Whatever no hypothesis foresees (waves, a tow) has a share of every block, so that no block decides alone.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.readings.findings import Finding
from glider.tools.readings.regression import within
from glider.tools.readings.signals import Rates, SignalTable, body_increments, pieces, summed

DECIDED = math.log(20.0)  # nat of odds, from which one of the two is falsely flagged
DEGREES = 180.0 / math.pi
ATTITUDE_MISMATCH = 0.02  # rad that summed rates and attitude may differ by within a block, whatever is right
SCALE_SD = 0.1  # of a gyro's scale, logarithm; a share UNFORESEEN of gyros may have any
ANY_SCALE_SD = 1.5
UNFORESEEN = 0.05
SUSPECT_SHARE = 0.3  # of an axis' motion that its rate leaves, for a fault to be looked for
FAULTY = 1e-3  # of cases have any one of these faults
RATE, RATE_SD = math.log(0.1), 1.2  # of the logarithm of rms rates, rad/s
SPEEDS = 0.3 * np.exp(0.7 * np.linspace(-2.0, 2.0, 9))  # m/s, with weights of a normal distribution
SPEED_WEIGHT = np.exp(-0.5 * np.linspace(-2.0, 2.0, 9) ** 2)
ATTACK = 0.12 * np.linspace(-2.0, 2.0, 7)  # rad
ATTACK_WEIGHT = np.exp(-0.5 * np.linspace(-2.0, 2.0, 7) ** 2)
VERTICAL_SD, UNFORESEEN_SD = 0.03, 0.4  # m/s, of the depth rate in a block: water and gauge; anything


@dataclass(frozen=True)
class Fault:
    """One instrument read wrongly: columns by (factor, or the column whose reading is theirs)."""

    kind: str  # sign, units, axes
    group: tuple[str, ...]  # the columns of the instrument
    gains: dict[str, float] = field(default_factory=dict)  # what was read is so many times what is right
    swapped: tuple[str, ...] = ()
    euler: bool = False  # the rates are those of the Euler angles

    @property
    def columns(self) -> tuple[str, ...]:
        return self.swapped or tuple(self.gains)

    def fix_axes_signs_units(self, table: SignalTable) -> SignalTable:
        """The table as it would be without the fault."""
        columns = dict(table.columns)
        for name, gain in self.gains.items():
            columns[name] = columns[name] / gain
        if self.swapped:
            one, other = self.swapped
            columns[one], columns[other] = columns[other], columns[one]
        if self.euler:
            (roll, pitch, _), (p, q, r) = ([columns[name] for name in group] for group in (names.ATTITUDE, names.RATES))
            body = (p - r * np.sin(pitch), q * np.cos(roll) + r * np.cos(pitch) * np.sin(roll),
                    r * np.cos(pitch) * np.cos(roll) - q * np.sin(roll))  # fmt: skip
            columns |= zip(names.RATES, body, strict=True)
        return replace(table, columns=columns)


@dataclass(frozen=True)
class Weighed:
    """The most probable fault, the odds against the best one of the other instrument (nat), and by which witness."""

    fault: Fault
    other: Fault
    odds: float
    witness: str

    @property
    def decided(self) -> bool:
        return self.odds >= DECIDED

    @property
    def odds_said(self) -> str:
        most = math.log(1e6)
        return f"{'over ' if self.odds > most else ''}{math.exp(min(self.odds, most)):.2g} to 1 by {self.witness}"


def faults(table: SignalTable) -> Iterator[Fault]:
    """Every way in which one of the instruments alone may read a sign, a unit or an axis wrongly."""
    groups = [group for group in (names.ATTITUDE, names.RATES) if table.has(*group)]
    pitch, depth = names.ATTITUDE[1], names.DEPTH
    if len(groups) == 2:
        yield Fault("axes", names.RATES, euler=True)
        for group in groups:
            yield from (Fault("axes", group, swapped=pair) for pair in combinations(group, 2))
            for some in (some for count in (1, 2, 3) for some in combinations(group, count)):
                yield Fault("sign", group, dict.fromkeys(some, -1.0))
                yield from (Fault("units", group, dict.fromkeys(some, f)) for f in (DEGREES, 1.0 / DEGREES))
    if table.has(pitch, depth):
        yield Fault("sign", (depth,), {depth: -1.0})
        if len(groups) == 2:
            yield Fault("sign", (*names.ATTITUDE, *names.RATES), {pitch: -1.0, names.RATES[1]: -1.0})
        elif table.has(*names.ATTITUDE):
            yield Fault("sign", names.ATTITUDE, {pitch: -1.0})


def weigh(table: SignalTable) -> Weighed | None:
    """Which instrument reads a sign, a unit or an axis wrongly; None where that none does is as probable."""
    if not suspicious(table):
        return None
    sound, found = likelihoods(table), []
    for fault in faults(table):
        evidence = likelihoods(fault.fix_axes_signs_units(table))
        found.append((sum(evidence.values()), evidence, fault))
    found.sort(key=lambda one: -one[0])
    if not found or found[0][0] - sum(sound.values()) < DECIDED - math.log(FAULTY):
        return None
    best, evidence, fault = found[0]
    if fault.euler:  # measured and said by rates.judge_rates
        return None
    second, against, other = next((one for one in found if one[2].group != fault.group), (-math.inf, sound, fault))
    witness = max(evidence, key=lambda name: evidence[name] - against[name])
    return Weighed(fault, other, best - second, witness)


def suspicious(table: SignalTable) -> bool:
    """Whether it is worth asking: an axis on which the rates do not account for the attitude, or a glide tail first."""
    if table.has(*names.RATES, *names.ATTITUDE):
        for axis in summed_up(table, names.ATTITUDE):
            if axis.motion > ATTITUDE_MISMATCH**2 and (
                axis.left > SUSPECT_SHARE * axis.motion or abs(axis.log_slope) > 0.5 * math.log(DEGREES)
            ):
                return True
    pitch = names.ATTITUDE[1]
    if not table.has(names.DEPTH, pitch):
        return False
    return glides(replace(table, columns=table.columns | {pitch: -table.columns[pitch]})) > glides(table)


def likelihoods(table: SignalTable) -> dict[str, float]:
    """Logarithms of the likelihoods of all witnesses, by name, of a table put right."""
    found, rates, attitude = {}, table.has(*names.RATES), table.has(*names.ATTITUDE)
    if rates:
        sizes = [rms(table.flown(table.columns[name])) for name in names.RATES]
        found["the size of the rates"] = sum(-0.5 * ((math.log(max(s, 1e-9)) - RATE) / RATE_SD) ** 2 for s in sizes)
    if rates and attitude:
        found["the rates about all axes"] = consistent(table, names.ATTITUDE)
    if table.has(names.DEPTH, names.ATTITUDE[1]):
        found["the depth rate"] = glides(table)
    if table.has(*names.MOCAP_ATTITUDE):
        found["motion capture"] = (consistent(table, names.MOCAP_ATTITUDE) if rates else 0.0) + (
            captured(table) if attitude else 0.0
        )
    return found


@dataclass(frozen=True)
class Axis:
    """The summed attitude of one axis on the summed rate, within blocks."""

    log_slope: float  # logarithm; infinite where no positive one is
    left: float  # mean squares, rad2
    motion: float
    blocks: int


def summed_up(table: SignalTable, columns: tuple[str, ...]) -> list[Axis]:
    """By axis, how far the rates account for an attitude: but for a scale, a bias and a lag."""
    attitude = table.flown(np.column_stack([table.columns[name] for name in columns]))
    turned = body_increments(attitude)
    turned[np.flatnonzero(np.diff(table.run)) + 1] = np.nan
    rates = Rates(table, np.column_stack([table.columns[name] for name in names.RATES]))
    moved = rates.integrated()
    usable = np.isfinite(moved).all(axis=1) & np.isfinite(turned).all(axis=1)
    if usable.sum() < 20:
        return []
    group = table.block[usable] * 100_003 + pieces(usable)[usable]
    both = np.column_stack([summed(turned, usable), summed(moved, usable), table.t, rates.shifted(0.0)])[usable]
    A, G, t, w = np.split(within(both, group), (3, 6, 7), axis=1)
    blocks, found = len(np.unique(table.block[usable])), []
    for axis in range(3):
        X = np.column_stack([G[:, axis], t, w[:, axis]])
        slope, log = np.linalg.lstsq(X, A[:, axis], rcond=None)[0], math.inf
        if slope[0] > 1e-6:
            log = math.log(slope[0])
        else:  # the other way round: no scale explains it
            X = X[:, 1:]
            slope = np.linalg.lstsq(X, A[:, axis], rcond=None)[0]
        left = float(np.mean((A[:, axis] - X @ slope) ** 2))
        found.append(Axis(log, left, float(np.mean(A[:, axis] ** 2)), blocks))
    return found


def consistent(table: SignalTable, columns: tuple[str, ...]) -> float:
    """Of an attitude, given the rates, against one of as much motion that has nothing to do with them."""
    total = 0.0
    for axis in summed_up(table, columns):
        total += _scale(min(axis.log_slope, 3.0 * ANY_SCALE_SD))
        total -= 0.5 * axis.blocks * math.log((axis.left + ATTITUDE_MISMATCH**2) / (axis.motion + ATTITUDE_MISMATCH**2))
    return total


def _scale(log: float) -> float:
    """Logarithm of the density of a gyro's scale."""
    parts = ((1.0 - UNFORESEEN, SCALE_SD), (UNFORESEEN, ANY_SCALE_SD))
    return math.log(sum(share / sd * math.exp(-0.5 * (log / sd) ** 2) for share, sd in parts))


def glides(table: SignalTable) -> float:
    """Of the depth rate, given the pitch: a glider goes where its nose points, but for the angle of attack."""
    pitch = table.flown(table.columns[names.ATTITUDE[1]])
    depth = table.columns[names.DEPTH]
    total = 0.0
    for block in np.unique(table.block):
        rows = np.flatnonzero((table.block == block) & np.isfinite(pitch) & np.isfinite(depth))
        if len(rows) < 5:
            continue
        slope = np.polyfit(table.t[rows] - table.t[rows[0]], depth[rows], 1)[0]
        total += _goes(float(np.mean(pitch[rows])), float(slope))
    return total


def _goes(pitch: float, sinking: float) -> float:
    """Logarithm of the density of a depth rate, m/s, given the pitch."""
    unforeseen = UNFORESEEN / UNFORESEEN_SD * math.exp(-0.5 * (sinking / UNFORESEEN_SD) ** 2)
    if abs(pitch) > 0.5 * math.pi + 0.1:  # no pitch at all
        return math.log(unforeseen) - 3.0
    mean = SPEEDS[:, None] * np.sin(ATTACK[None, :] - pitch)
    weight = SPEED_WEIGHT[:, None] * ATTACK_WEIGHT[None, :]
    glided = float((weight * np.exp(-0.5 * ((sinking - mean) / VERTICAL_SD) ** 2)).sum() / weight.sum())
    return math.log((1.0 - UNFORESEEN) / VERTICAL_SD * glided + unforeseen)


def captured(table: SignalTable) -> float:
    """Of the onboard attitude, given motion capture's: the same but for a constant."""
    total = 0.0
    for name, seen in zip(names.ATTITUDE, names.MOCAP_ATTITUDE, strict=True):
        apart = np.sin(table.flown(table.columns[name] - table.columns[seen]))
        good = np.isfinite(apart)
        if good.sum() > 20:
            blocks = len(np.unique(table.block[good]))
            total -= 0.5 * blocks * math.log(float(np.var(apart[good])) + ATTITUDE_MISMATCH**2)
    return total


def rms(values: np.ndarray) -> float:
    """Root mean square of what is there."""
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if len(good) else 0.0


UNIT_WORDS = {True: "degrees where radians are meant", False: "radians where degrees were taken for them"}


def said(weighed: Weighed) -> list[Finding]:
    """The findings: of the instrument that is wrong, put right; or of the pair, and nothing is."""
    fault, other = weighed.fault, weighed.other
    against = ", ".join(other.columns)
    if weighed.decided:
        return [
            _finding(fault, name, against, f"{_means(fault, name)} ({weighed.odds_said}).") for name in fault.columns
        ]
    first, second = sorted((fault, other), key=lambda one: one.group != names.ATTITUDE)
    what = {
        "sign": "have opposite signs: one of them is turned",
        "units": "differ by the factor of degrees and radians: one of them is in another unit than its name says",
        "axes": "have their axes in another order: two of one are exchanged",
    }[fault.kind]
    text = f"{', '.join(first.columns)} and {', '.join(second.columns)} {what}; nothing in these runs decides which"
    odds = f" ({math.exp(weighed.odds):.2g} to 1 for {', '.join(fault.columns)})" if weighed.odds > 0.1 else ""
    return [replace(_finding(fault, fault.columns[0], against, f"{text}{odds}: look at the vehicle, and say it in the "
                             "mapping."), channel=second.columns[0], mended=False, values={})]  # fmt: skip


def _means(fault: Fault, name: str) -> str:
    if fault.kind == "axes":
        return f"{name} is what {next(one for one in fault.swapped if one != name)} should be: exchanged"
    if fault.kind == "sign":
        return f"{name} has the wrong sign"
    return f"{name} is {fault.gains[name]:.3g} times what it should be: {UNIT_WORDS[abs(fault.gains[name]) > 1.0]}"


def _finding(fault: Fault, name: str, against: str, text: str) -> Finding:
    size = fault.gains.get(name, 1.0)
    values = {"gain": size}
    if fault.kind == "axes":
        source = next(one for one in fault.swapped if one != name)
        values = {"from": float(fault.group.index(source)), "sign": 1.0}
    return Finding(name, against, fault.kind, size, (size, size), "1", None, True, text, values)
