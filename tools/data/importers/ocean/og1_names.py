"""Names of OceanGliders' common format, OG-1.0, as this project reads and writes them."""

import numpy as np

from glider.tools.data.importers.ocean import netcdf

ROWS = "N_MEASUREMENTS"  # the dimension
TIME, LATITUDE, LONGITUDE, SEGMENT = "TIME", "LATITUDE", "LONGITUDE", "SEGMENT_NUMBER"
TIME_GPS = "TIME_GPS"  # of fixes: rows of their own, or in files of before 2026 a dimension of their own
DIVES = (SEGMENT, "DIVE_NUMBER", "divenum", "dive_number")  # which dive a row is of, where a file says so
CTD = "SENSOR_CTD_UNKNOWN"  # whose serial number no case holds
MODEL, SERIAL, TRAJECTORY, WMO = "PLATFORM_MODEL", "PLATFORM_SERIAL_NUMBER", "TRAJECTORY", "WMO_IDENTIFIER"
CONVENTION = "OG-1.0"
EPOCH = "seconds since 1970-01-01T00:00:00Z"
# Of the models that PLATFORM_MODEL names (vocabulary B76): a word in it, and the vehicle of this project.
VEHICLES = {"slocum": "slocum", "seaglider": "seaglider", "seaexplorer": "seaexplorer"}
MODEL_NAMES = {
    "slocum": "Slocum",
    "seaglider": "Seaglider",
    "seaexplorer": "Seaexplorer",
}

# A volume and a length without a unit are in what a Seaglider logs them in: their names say so.
VOLUME = {"m3": 1.0, "m^3": 1.0, **netcdf.CUBIC_CENTIMETRES, "": 1e-6}
TRAVEL = {"m": -1.0, "cm": -0.01, "": -0.01}  # PITCH_CTL is positive where it pitches up: the mass is aft

# Run data: names in a file, the first that is there, each with its units. The first name is the one written.
Names = tuple[tuple[str, dict[str, float]], ...]
ATTITUDE: dict[str, Names] = {
    "pitch_rad": (("PITCH", netcdf.ANGLE),),
    "roll_rad": (("ROLL", netcdf.ANGLE),),
    "yaw_rad": (("HEADING", netcdf.ANGLE),),
}
OPTIONAL: dict[str, Names] = {
    "oil_m3": (("BUOYANCY_ENGINE_VOLUME", VOLUME), ("VBD_CC", VOLUME)),
    "battery_m": (("PITCH_MASS_POSITION", netcdf.METRES), ("PITCH_CTL", TRAVEL)),
    "fin_rad": (("RUDDER_ANGLE", netcdf.ANGLE),),
    "pump": (("BUOYANCY_ENGINE_RUNS", {"1": 1.0}),),
    "speed_m_s": (("MEASURED_SPEED_THROUGH_WATER", netcdf.SPEED),),
    "vn_m_s": (("MEASURED_NORTH_VELO_THROUGH_WATER", netcdf.SPEED),),
    "ve_m_s": (("MEASURED_EAST_VELO_THROUGH_WATER", netcdf.SPEED),),
}
PRESSURE, DEPTH, TEMPERATURE, SALINITY, CONDUCTIVITY = "PRES", "DEPTH", "TEMP", "PSAL", "CNDC"
VARIATION = "MAGNETIC_VARIATION"  # still to be added to HEADING
DENSITY = "DENSITY"  # in situ; read where the file has neither salinity nor conductivity
USABLE = np.array([0.0, 1.0, 2.0, 5.0, 8.0])  # flags: not judged, good, probably good, changed, estimated
