"""All of a NetCDF file of version 4 read once, by a process of its own: over a damaged one HDF5 may hang, or fall.

    python -m glider.tools.data.importers.ocean.netcdf_trial FILE SECONDS

The process is ended by the system after so many seconds of its own computing, however busy the machine is.
"""

import resource
import sys
from typing import Any


def read_all(path: str) -> None:
    """Look at every object of a file, its attributes and its values; what cannot be read raises what h5py raises."""
    import h5py

    def look(_name: str, found: Any) -> None:
        for name in found.attrs:
            found.attrs[name]
        if isinstance(found, h5py.Dataset):
            found[()]

    with h5py.File(path) as file:
        look("", file)
        file.visititems(look)


if __name__ == "__main__":
    seconds = int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    read_all(sys.argv[1])
