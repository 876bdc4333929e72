"""Runs of a user's vehicle flown by its own model with noise and known changes; sealed cases of the Fossen AUV.

`python -m tests.support.own_cases --out FOLDER` makes the cases of a seed, says the SHA-256 of their answers before the
first is asked about, and judges.
"""

import argparse
import hashlib
import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.own.decision import NONE, Posterior
from glider.tools.own.driven import driven_inputs
from glider.tools.own.effects import Effect, moved, nominal_point, standard_effects
from glider.tools.own.healthy import healthy_of
from glider.tools.own.identified import VEHICLE, write
from glider.tools.own.identify import identify
from glider.tools.own.load import LoadedVehicle, read_own
from glider.tools.own.noise_hypotheses import posterior_of
from glider.tools.own.observer import Observer
from glider.tools.own.posterior import Engine
from glider.tools.own.runs import OwnRun

FOSSEN = Path(__file__).parents[2] / "docs" / "examples" / "fossen_auv" / "remus.toml"
RATE, SECONDS = 5.0, 60.0  # of a run
SURE, NEAR = 0.5, 3.0  # probability of an answer that is given; sigmas within which a size is right
# label: size that a case has at least and at most, either sign; a heading's bias leaves no trace where there is neither
# a current nor a position
CHANGES = {
    "port_gain": (0.05, 0.15), "starboard_gain": (0.05, 0.15), "elevator_offset": (0.03, 0.08),
    "pitch_bias": (0.02, 0.06), "current_north": (0.05, 0.3), "current_east": (0.05, 0.3), "thruster_y": (0.03, 0.08),
    "thruster_z": (0.03, 0.08), "pressure_x": (0.3, 0.8), "log_forward_gain": (0.04, 0.1),
}  # fmt: skip


def legs(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, inputs and first state of a run: propellers apart and elevator by turns, any heading."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    turns, dives = rng.uniform(-5.0, 5.0, 20), rng.uniform(-0.12, 0.12, 20)
    middle = rng.uniform(15.0, 20.0) + 2.0 * np.sin(2.0 * np.pi * t / 40.0)
    turn = turns[(t // 12.0).astype(int)]
    u = np.column_stack([middle + turn, middle - turn, dives[(t // 9.0).astype(int)]])
    return t, u, np.array([20.0, 0.0, 0.0, rng.uniform(-3.0, 3.0), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def fly(vehicle: LoadedVehicle, seed: int, changes: Mapping[str, float], runs: int = 3) -> list[OwnRun]:
    """Runs with changes of sizes in their units; noise of the model and of the sensors as declared."""
    declared, kernels = vehicle.declared, vehicle.kernels
    rng, made = np.random.default_rng(seed), []
    noise = np.array([one.noise or 0.0 for one in declared.outputs])
    density = np.array([one.density for one in declared.noises])
    for n in range(runs):
        t, u, x = legs(rng)
        y = np.empty((len(t), len(declared.outputs)))
        run = OwnRun(f"run{n:03}", t, u, y)
        effects = {one.label: one for one in standard_effects(declared, [run], np.ones(len(noise)))}
        own = [effects[label] for label in changes]
        point = moved(
            declared, nominal_point(declared), own, np.array([changes[one.label] / one.spread for one in own])
        )
        driven = driven_inputs(run, declared, point)
        for row in range(len(t)):
            y[row] = point.reading[0] * kernels.measure(x, driven[row], point.theta) + point.reading[1]
            if row + 1 < len(t):
                dt = t[row + 1] - t[row]
                w = density * rng.standard_normal(len(density)) / np.sqrt(dt)
                x = kernels.advance(x, driven[row], w, point.theta, dt, 2)
        made.append(replace(run, outputs=y + noise * rng.standard_normal(y.shape)))
    return made


def identified(vehicle: LoadedVehicle, seed: int, folder: Path, runs: int = 6) -> LoadedVehicle:
    """The vehicle as identified from runs without a change."""
    write(identify(vehicle, [fly(vehicle, seed, {}, runs)]), folder)
    return read_own(folder / VEHICLE)


def diagnosed(vehicle: LoadedVehicle, runs: list[OwnRun]) -> Posterior:
    """What a case of runs has."""
    observer = Observer(vehicle, runs)
    return posterior_of(Engine(observer, healthy_of(observer)))


def size_of(answer: Posterior, label: str) -> tuple[float, float]:
    """Size of a label and its 1 sigma in the most probable hypothesis that has it, in its unit."""
    having = [
        (weight, one) for weight, one in zip(answer.weights, answer.hypotheses, strict=True) if label in one.labels
    ]
    best = max(having, key=lambda pair: pair[0])[1]
    effect: Effect = answer.healthy.effects[answer.healthy.at([label])[0]]
    place = best.labels.index(label)
    return float(best.sizes[place] * effect.spread), float(best.sd[place] * effect.spread)


def answers(seed: int, count: int) -> list[dict[str, float]]:
    """Of `count` cases: every third none, else one change."""
    rng = np.random.default_rng(seed)
    found: list[dict[str, float]] = []
    for n in range(count):
        label = str(rng.choice(list(CHANGES)))
        size = float(rng.uniform(*CHANGES[label]) * rng.choice([-1.0, 1.0]))
        found.append({} if n % 3 == 2 else {label: round(size, 4)})
    return found


def judge(seed: int, count: int, folder: Path, say: Callable[[str], None]) -> dict[str, Any]:
    """Cases made, their answers' hash said, asked about, judged."""
    vehicle = read_own(FOSSEN)
    truth = answers(seed, count)
    say(f"answers: sha256 {hashlib.sha256(json.dumps(truth).encode()).hexdigest()}")
    model = identified(vehicle, seed + 1, folder)
    score: Counter[str] = Counter()
    for n, one in enumerate(truth):
        answer = diagnosed(model, fly(vehicle, seed + 2 + n, one))
        ranked = sorted(answer.chances.items(), key=lambda pair: -pair[1])
        first, chance = ranked[0]
        label, size = next(iter(one.items()), (NONE, 0.0))
        score["none" if not one else "changed"] += 1
        score["none right" if not one else "changed right"] += int(first == label)
        score["sure and wrong"] += int(first != label and chance > SURE)
        said = f"case{n:03} {label} {size:+.4g}: {first} {chance:.2f}"
        if one and first == label:
            mean, sd = size_of(answer, label)
            score["size right"] += int(abs(mean - size) < NEAR * sd)
            said += f", {mean:+.4g} +- {sd:.2g}"
        say(said)
    return dict(score)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    print(json.dumps(judge(given.seed, given.count, given.out, lambda text: print(text, flush=True))))


if __name__ == "__main__":
    main()
