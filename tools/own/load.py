"""From `--vehicle blimp.toml` to a model that has been tried: imported, declared, called, checked.

Errors of the user's file name that file and its line.
"""

import hashlib
import importlib
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from glider.hal.strict import ConfigError, locate
from glider.tools.data.errors import InputError
from glider.tools.data.sources import read_text
from glider.tools.own.compiled import Kernels, kernels_of
from glider.tools.own.declare import QUATERNION, Declaration, DeclarationError, declaration, is_black_box
from glider.tools.own.files import OwnVehicle, declared_with, decode_own
from glider.tools.own.kernel_processes import side_by_side
from glider.tools.own.neighbours import import_file, neighbours

ENTRY_POINTS = "glider.vehicles"
PROGRAM = "exec:"


@dataclass
class LoadedVehicle:
    """A vehicle file and the model that it names."""

    path: Path
    text: str
    file: OwnVehicle
    model: Any
    source: Path | None  # of the model's code
    attribute: str
    declared: Declaration
    level: int  # 0: rollout only; 1: step, measure
    notes: list[str] = field(default_factory=list)
    _kernels: Kernels | None = None

    @property
    def name(self) -> str:
        return self.file.name or self.path.stem

    @property
    def folder(self) -> Path:
        """Where its model is looked for."""
        return self.path.parent / self.file.model_folder

    def zeros(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """x, u, w, theta of a vehicle at rest."""
        declared, states = self.declared, list[float]()
        for n, one in enumerate(declared.states):
            begins = one.kind == QUATERNION and (n == 0 or declared.states[n - 1].kind != QUATERNION)
            states.append(1.0 if begins else one.start)
        theta = [one.value for one in declared.parameters]
        return (
            np.array(states, dtype=np.float64), np.zeros(len(declared.inputs)), np.zeros(len(declared.noises)),
            np.array(theta, dtype=np.float64),
        )  # fmt: skip

    @property
    def kernels(self) -> Kernels:
        """The observer of the model, made when it is first asked for."""
        if self._kernels is None:
            self._kernels = kernels_of(
                self.model, self.source, self.attribute, self.zeros(), len(self.declared.outputs)
            )
            if not self._kernels.compiled:
                self._kernels = side_by_side(self._kernels, self.path)
        return self._kernels


def read_own(path: Path) -> LoadedVehicle:
    """A vehicle file with `model`, its functions not tried yet; ConfigError or InputError where it cannot be used."""
    text = read_text(path)
    given = decode_own(text, str(path))

    def wrong(message: str) -> ConfigError:
        return ConfigError(str(path), message, key="model", line=locate(text, ["model"]))

    model, source, attribute = _import(given.model, path.parent / given.model_folder, wrong)
    try:
        declared = declaration(model)
    except DeclarationError as error:
        raise InputError(str(error), source=source or path) from None
    except (TypeError, ValueError) as error:
        raise user_error(error, source, "the declaration") from None
    declared = declared_with(declared, given, text, path)
    black_box = is_black_box(model)
    if not black_box and not hasattr(model, "step") and not hasattr(model, "derivative"):
        raise InputError("the model has none of step, derivative, rollout", source=source or path)
    if not black_box and not hasattr(model, "measure"):
        raise InputError("the model has no measure(x, u, theta)", source=source or path)
    return LoadedVehicle(path, text, given, model, source, attribute, declared, 0 if black_box else 1)


def _import(wanted: str, folder: Path, wrong: Callable[[str], ConfigError]) -> tuple[Any, Path | None, str]:
    """The model object, its file, and its name in it."""
    if wanted.endswith(".fmu"):
        from glider.tools.own.fmu import FmuModel

        file = folder.resolve() / wanted
        if not file.is_file():
            raise wrong(f"no file {wanted} beside it")
        return FmuModel(file), file, ""
    if wanted.startswith(PROGRAM):
        from glider.tools.own.process import ProcessModel

        return ProcessModel(wanted.removeprefix(PROGRAM).strip(), folder), None, ""
    if ":" not in wanted and not (folder / f"{wanted}.py").is_file():
        found = [one for one in metadata.entry_points(group=ENTRY_POINTS) if one.name == wanted]
        if not found:
            beside = f"no file {wanted}.py beside it and no such name in {ENTRY_POINTS}"
            raise wrong(f"{beside if wanted.isidentifier() else f'got {wanted!r}'}: expected module, module:object, "
                        "a file.fmu, exec:COMMAND, or a name there")  # fmt: skip
        wanted = found[0].value
    module_name, _, attribute = wanted.partition(":")
    file = folder.resolve() / f"{module_name}.py"
    try:
        if file.is_file():
            # the same in every process: what Numba keeps of the user's own compiled functions names their module
            name = f"glider_own_given_{hashlib.sha256(str(file).encode()).hexdigest()[:16]}"
            module, _ = import_file(name, file, folder)
        else:
            module = importlib.import_module(module_name)
            file = Path(module.__file__) if module.__file__ else file
    except ModuleNotFoundError as error:
        if error.name == module_name:
            raise wrong(f"no file {module_name}.py beside it, and no such module") from None
        raise user_error(error, file, "import") from None
    except Exception as error:  # whatever the user's module raises
        raise user_error(error, file, "import") from None
    if not attribute:
        return module, file, ""
    owner: Any = module
    for part in attribute.split("."):
        if not hasattr(owner, part):
            raise wrong(f"{file.name} has no {attribute}")
        owner = getattr(owner, part)
    if isinstance(owner, type) and not _static(owner):
        try:
            owner = owner()
        except Exception as error:
            raise user_error(error, file, attribute) from None
    return owner, file, attribute


def _static(owner: type) -> bool:
    """Whether a class has its functions as static methods, so that it needs no instance."""
    return all(
        isinstance(vars(owner).get(name, staticmethod(len)), staticmethod)
        for name in ("step", "derivative", "measure", "rollout", "initial")
    )


def user_error(error: BaseException, source: Path | None, where: str) -> InputError:
    """An exception of the user's code as one line: file (the model's or one beside it), line, where, what it said."""
    if isinstance(error, SyntaxError):
        return InputError(f"{where}: {error.msg}", source=error.filename, line=error.lineno)
    frames = traceback.extract_tb(error.__traceback__)
    files = [] if source is None else [source, *neighbours(source)]
    own = [(file, one.lineno) for one in frames for file in files if Path(one.filename).name == file.name]
    file, line = own[-1] if own else (source, None)
    said = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return InputError(f"{where}: {said}", source=file, line=line)


def called(vehicle: LoadedVehicle, name: str, *given: Any) -> np.ndarray:
    """A function of the model, called as plain Python; InputError with the user's line where it raises."""
    try:
        return getattr(vehicle.model, name)(*given)
    except Exception as error:  # whatever the user's function raises
        raise user_error(error, vehicle.source, name) from None
