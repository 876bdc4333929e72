"""NetCDF files, classic and of version 4, as variables with strict units."""

import multiprocessing
import resource
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file
from glider.tools.data.importers.ocean.segment import require_unit

MAX_FILE_BYTES = 4_000_000_000
LEAST_READ_S, READ_BYTES_PER_S = 5, 1_000_000  # of one processor, at most, that reading a file takes
CLASSIC, HDF5 = b"CDF", b"\x89HDF\r\n\x1a\n"
METRES = dict.fromkeys(("m", "meters", "metres", "meter", "metre"), 1.0)
DBAR = dict.fromkeys(("dbar", "decibar", "decibars"), 1.0)
_DEGREES_CELSIUS = ("degrees_Celsius", "degree_Celsius", "Celsius", "degC", "deg_C", "degree_C", "degrees_C", "°C")
CELSIUS = dict.fromkeys(_DEGREES_CELSIUS, 1.0)
SIEMENS = dict.fromkeys(("S/m", "S m-1", "S.m-1", "mhos/m"), 1.0) | dict.fromkeys(("mS/cm", "mS cm-1"), 0.1)
PRACTICAL = dict.fromkeys(("1e-3", "1", "psu", "PSU", "0.001", "1E-3", "dimensionless"), 1.0)
ANGLE = dict.fromkeys(("degrees", "degree", "deg", "°"), np.pi / 180.0)
ANGLE |= dict.fromkeys(("radians", "radian", "rad"), 1.0)
CUBIC_CENTIMETRES = dict.fromkeys(("cc", "cm^3", "cm3", "cm**3", "mL", "ml"), 1e-6)
SECONDS = {"seconds": 1.0, "s": 1.0}
SPEED = dict.fromkeys(("m/s", "m s-1", "m.s-1"), 1.0) | dict.fromkeys(("cm/s", "cm s-1"), 0.01)
DENSITY = dict.fromkeys(("kg/m3", "kg m-3", "kg.m-3", "kg/m^3"), 1.0)


class NetCDF:
    """An opened file: variables by name, as float64 with NaN where one is missing."""

    def __init__(self, path: Path):
        self.path = path
        self._dataset = _opened(path)

    def attribute(self, name: str) -> str:
        """A global attribute as text; empty where it is not there."""
        return str(self._dataset.attrs.get(name, "")).strip()

    def has(self, name: str) -> bool:
        """Whether there is a variable of this name."""
        return name in self._dataset.variables

    def size(self, dimension: str) -> int | None:
        """Length of a dimension; None where there is none of this name."""
        return self._dataset.sizes.get(dimension)

    def about(self, name: str, attribute: str) -> str:
        """An attribute of a variable as text; empty where it is not there."""
        return str(self._dataset.variables[name].attrs.get(attribute, "")).strip()

    def text(self, name: str) -> str:
        """A variable that holds one text; empty where it is not there."""
        if not self.has(name):
            return ""
        value = np.asarray(self._dataset.variables[name].values).ravel()
        parts = [one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in value.tolist()]
        return "".join(parts).strip()

    def values(self, name: str, units: dict[str, float], rows: int | None = None) -> np.ndarray:
        """A variable in SI, by its unit (`""` among `units`: it may have none); InputError where it is not as asked."""
        if not self.has(name):
            raise InputError("the variable is not in this file", source=self.path, column=name)
        variable = self._dataset.variables[name]
        factor = require_unit(self.about(name, "units"), units, self.path, name)
        if variable.dtype.kind not in "fiu":
            raise InputError("no numbers", source=self.path, column=name)
        found = factor * np.asarray(variable.values, dtype=np.float64).ravel()
        if rows is not None and len(found) != rows:
            raise InputError(f"{len(found)} samples, expected {rows}", source=self.path, column=name)
        return np.where(np.isfinite(found), found, np.nan)

    def number(self, name: str, units: dict[str, float]) -> float:
        """A variable that holds one number, in SI."""
        return float(self.values(name, units, rows=1)[0])

    def flags(self, name: str, rows: int) -> np.ndarray:
        """Quality flags, numbers or digits, as float64, NaN where there is none; all NaN where the file has none."""
        if not self.has(name):
            return np.full(rows, np.nan)
        values = np.asarray(self._dataset.variables[name].values).ravel()
        if len(values) != rows:
            raise InputError(f"{len(values)} samples, expected {rows}", source=self.path, column=name)
        if values.dtype.kind in "SUO":
            digits = [one.decode("ascii", "replace") if isinstance(one, bytes) else str(one) for one in values.tolist()]
            values = np.array([float(one) if one.strip().isdigit() else np.nan for one in digits])
        return values.astype(np.float64)


def _opened(path: Path) -> Any:
    """The file in memory, as an xarray Dataset; InputError where it is none or is cut."""
    import xarray

    require_file(path, MAX_FILE_BYTES)
    if not path.stat().st_size:
        raise InputError("the file is empty", source=path)
    with path.open("rb") as file:
        begin = file.read(8)
    if not (begin.startswith(CLASSIC) or begin == HDF5):
        raise InputError("not a NetCDF file", source=path)
    engine = "h5netcdf" if begin == HDF5 else "scipy"
    try:
        if engine == "h5netcdf":
            with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as reader:
                reader.submit(_read_all, path).result()
        with xarray.open_dataset(path, engine=engine, decode_times=False, decode_timedelta=False) as dataset:
            return dataset.load()
    except BrokenProcessPool:
        raise InputError("damaged: reading it fails or does not end", source=path) from None
    # What the libraries raise on damage is not said by them: OSError, ValueError, struct.error, KeyError, TypeError.
    except Exception as error:
        what = (str(error) or repr(error)).splitlines()[0].strip("'\"")
        raise InputError(f"cut or damaged: {what}", source=path) from None


def _read_all(path: Path) -> None:
    """Read all of a file of version 4, in a process of its own: on damage HDF5 may read for ever, or die.

    h5py's errors are clean; h5netcdf would leave half-opened files behind.
    """
    import h5py

    seconds = LEAST_READ_S + path.stat().st_size // READ_BYTES_PER_S
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    with h5py.File(path) as file:
        file.visititems(_read)


def _read(_name: str, found: Any) -> None:
    """Read an object of a file whole."""
    if hasattr(found, "shape"):
        found[()]
