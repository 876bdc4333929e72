"""`corrected.toml`: a nominal vehicle, its parameters refitted, effects added; `glider gap predict` takes it."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from glider.firmware.core.vehicle import layout
from glider.hal.strict import ConfigError, Table, decode
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.sources import read_text
from glider.tools.inference.kind import ROUGHIE
from glider.tools.inference.model import Model, add_effects, effect_vector

LINKS = (
    "surge force", "sway force", "heave force", "roll moment", "pitch moment", "yaw moment", "servo", "slider",
    "ballast", "roll", "pitch", "yaw", "roll rate", "pitch rate", "yaw rate", "depth", "slider wire", "ballast wire",
)  # fmt: skip
BIASES = {reading.name: reading.bias for reading in ROUGHIE.readings if reading.bias >= 0}
BIASES["depth_with_ballast"] = ef.GAUGE_TANK  # m/kg
NAMES = {
    name.lower(): getattr(layout, name)
    for name in dir(layout)
    if name.isupper() and isinstance(getattr(layout, name), int)
}
PARAMETERS = {
    name: index for name, index in NAMES.items() if not name.startswith(("n_", "x_pos", "x_quat", "x_nu", "x_act"))
}
Finite = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]


class CorrectionTable(Table):
    """[correction]: the link at which it enters, and its coefficients by shape, in the link's unit."""

    link: str
    shapes: dict[str, Finite]


class CorrectedTable(Table):
    """corrected.toml."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    corrected: bool
    vehicle: str
    parameters: dict[str, Finite] = msgspec.field(default_factory=dict)
    bias: dict[str, Finite] = msgspec.field(default_factory=dict)
    effects: dict[str, dict[str, Finite]] = msgspec.field(default_factory=dict)
    correction: CorrectionTable | None = None


def is_corrected(text: str) -> bool:
    """Whether a file says of itself that it is a corrected model."""
    return any(line.split("=")[0].strip() == "corrected" for line in text.splitlines() if "=" in line)


def load_corrected(path: Path | str, nominal: Model) -> Model:
    """The model of a corrected.toml on top of a case's nominal vehicle; ConfigError where it cannot be used."""
    source = str(path)
    table = decode(read_text(Path(path)), CorrectedTable, source)
    if not table.corrected:
        raise ConfigError(source, "must be true", key="corrected")
    P, F = nominal.P.copy(), effect_vector(nominal)
    for name, value in table.parameters.items():
        if name not in PARAMETERS:
            raise ConfigError(source, "no such parameter", key=f"parameters.{name}")
        P[PARAMETERS[name]] = value
    for name, value in table.bias.items():
        if name not in BIASES:
            raise ConfigError(source, f"no such reading; known: {', '.join(BIASES)}", key=f"bias.{name}")
        F[BIASES[name]] += value
    add_effects(F, table.effects, source)
    if table.correction is not None:
        _correct(F, table.correction, source)
    return Model(source, P, nominal.sigma, F)


def _correct(F: np.ndarray, table: CorrectionTable, source: str) -> None:
    if table.link not in LINKS:
        raise ConfigError(source, f"no such link; known: {', '.join(LINKS)}", key="correction.link")
    F[ef.LINK] = 1.0 + LINKS.index(table.link)
    for name, value in table.shapes.items():
        if name not in ef.SHAPES:
            raise ConfigError(source, f"no such shape; known: {', '.join(ef.SHAPES)}", key=f"correction.shapes.{name}")
        F[ef.SHAPE + ef.SHAPES.index(name)] = value


def corrected_text(
    vehicle: str, nominal: np.ndarray, P: np.ndarray, F: np.ndarray, effects: dict[str, dict[str, float]]
) -> str:
    """The text of a corrected.toml: what differs from the nominal P (N_P), biases out of F, and effects by label."""
    lines = [
        "# A corrected model: the nominal vehicle, its parameters refitted within their uncertainty, effects added.",
        "# Fly it over a run with `glider gap predict RUN --model corrected.toml --out FILE`.",
        "format = 1",
        "corrected = true",
        f"vehicle = {msgspec.json.encode(vehicle).decode()}",
        "",
        "[parameters]  # SI",
    ]
    by_index: dict[int, str] = {}
    for name, index in PARAMETERS.items():
        by_index.setdefault(index, name)
    lines += [f"{by_index[int(i)]} = {float(P[i])!r}" for i in np.flatnonzero(nominal != P)]
    lines += ["", "[bias]  # of what is read, SI, rad"]
    lines += [f"{name} = {float(F[entry])!r}" for name, entry in BIASES.items() if F[entry] != 0.0]
    for label, values in effects.items():
        lines += ["", f"[effects.{label}]", *(f"{name} = {float(value)!r}" for name, value in values.items())]
    if F[ef.LINK] > 0.0:
        lines += ["", "[correction]  # no cause: what these runs ask for at this link, tools/diagnose/correction"]
        lines += [f'link = "{LINKS[int(F[ef.LINK]) - 1]}"', "", "[correction.shapes]"]
        shapes = F[ef.SHAPE : ef.SHAPE + ef.N_SHAPES]
        lines += [f'"{name}" = {float(v)!r}' for name, v in zip(ef.SHAPES, shapes, strict=True) if v != 0.0]
    return "\n".join(lines) + "\n"
