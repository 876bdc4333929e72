"""Native files of ocean gliders made from a flight that is known: what an importer reads back can be held to it."""

import datetime as dt
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import gsw
import numpy as np

LATITUDE, LONGITUDE, SALINITY = 45.25, -20.5, 35.0
NORTHWARD = 0.003  # deg from the fix before a dive to the one behind it
START = 1_600_000_000.0  # s since 1970-01-01 UTC


@dataclass
class Flight:
    """A dive that is known: the vehicle's rows, and the CTD's samples, in SI (pressure dbar, conductivity S/m)."""

    t: np.ndarray  # s since 1970
    columns: dict[str, np.ndarray]  # at t, as run data; density_kg_m3 and temperature_c of the water there
    ctd_t: np.ndarray
    pressure: np.ndarray
    temperature: np.ndarray
    conductivity: np.ndarray
    extra: dict[str, np.ndarray] = field(default_factory=dict)


def flight(
    start: float = START, rows: int = 120, step_s: float = 5.0, ctd_s: float = 2.0, deepest: float = 60.0
) -> Flight:
    """Down and up once, in water that is colder below; the CTD has its own times."""
    t = start + step_s * np.arange(rows)
    ctd_t = np.arange(t[0] - 3.0, t[-1] + 3.0, ctd_s)
    middle = 0.5 * (t[0] + t[-1])

    def depth(moment: np.ndarray) -> np.ndarray:
        return 2.0 + deepest * (1.0 - np.abs(moment - middle) / (middle - t[0]))

    down = t < middle
    columns = {
        "t_s": t - t[0],
        "depth_m": depth(t),
        "pitch_rad": np.where(down, -0.44, 0.41) + 0.01 * np.sin(t / 30.0),
        "roll_rad": 0.05 + 0.02 * np.sin(t / 20.0),
        "yaw_rad": 3.0 + 0.3 * np.sin(t / 100.0),
        "oil_m3": np.where(down, -2.2e-4, 2.3e-4),
        "battery_m": np.where(down, 0.012, -0.008),
        "fin_rad": 0.04 * np.sin(t / 50.0),
        "pump": (np.abs(t - middle) < 15.0).astype(float),
    }
    columns["yaw_rad"] = (columns["yaw_rad"] + np.pi) % (2.0 * np.pi) - np.pi
    columns["temperature_c"] = temperature(depth(t))
    columns["density_kg_m3"] = density(depth(t))
    pressure = gsw.p_from_z(-depth(ctd_t), LATITUDE)
    water = temperature(depth(ctd_t))
    conductivity = gsw.C_from_SP(SALINITY, water, pressure) / 10.0
    return Flight(t, columns, ctd_t, pressure, water, conductivity)


def temperature(depth: np.ndarray) -> np.ndarray:
    """In-situ temperature, degC, of the water made here; linear, so that interpolated samples are exact."""
    return 18.0 - 0.1 * depth


def density(depth: np.ndarray) -> np.ndarray:
    """In-situ density, kg/m3, of the water made here."""
    pressure = gsw.p_from_z(-depth, LATITUDE)
    absolute = gsw.SA_from_SP(SALINITY, pressure, LONGITUDE, LATITUDE)
    return gsw.rho_t_exact(absolute, temperature(depth), pressure)


def degrees_minutes(degrees: float) -> float:
    """ddmm.mmm, as Slocum and SeaExplorer write positions."""
    return float(np.sign(degrees)) * (abs(degrees) // 1.0 * 100.0 + abs(degrees) % 1.0 * 60.0)


# --- SeaExplorer ---


def seaexplorer(folder: Path, one: Flight, segment: int = 1, glider: str = "sea009", mission: int = 4) -> list[Path]:
    """Navigation and payload table of a segment."""
    c = one.columns
    degrees = {name: np.degrees(c[name]) for name in ("pitch_rad", "roll_rad", "yaw_rad")}
    navigation = ["Timestamp;NavState;Heading;Declination;Pitch;Roll;Depth;Lat;Lon;BallastPos;LinPos;"]
    last = len(one.t) - 1
    for n, moment in enumerate(one.t):  # its position is the last fix until it is afloat again (116), and has another
        north = LATITUDE + (NORTHWARD if n == last else 0.0)
        position = f"{degrees_minutes(north):.6f};{degrees_minutes(LONGITUDE):.4f}"
        navigation.append(
            f"{_stamp(moment)};{116 if n in (0, last) else 100};"
            f"{degrees['yaw_rad'][n] % 360.0:.6f};5;{degrees['pitch_rad'][n]:.6f};"
            f"{degrees['roll_rad'][n]:.6f};{c['depth_m'][n]:.6f};{position};{1e6 * c['oil_m3'][n]:.4f};"
            f"{1e3 * c['battery_m'][n]:.4f};"
        )
    payload = ["PLD_REALTIMECLOCK;NAV_DEPTH;GPCTD_CONDUCTIVITY;GPCTD_TEMPERATURE;GPCTD_PRESSURE;"]
    for n, moment in enumerate(one.ctd_t):
        payload.append(
            f"{_stamp(moment, 'milliseconds')};1.0;{one.conductivity[n]:.8f};{one.temperature[n]:.6f};"
            f"{one.pressure[n]:.6f};"
        )
    paths = [folder / f"{glider}.{mission}.{kind}.sub.{segment}" for kind in ("gli", "pld1")]
    for path, lines in zip(paths, (navigation, payload), strict=True):
        path.write_text("\n".join(lines) + "\n")
    return paths


def _stamp(moment: float, digits: str = "seconds") -> str:
    date = dt.datetime.fromtimestamp(moment, dt.UTC)
    return f"{date:%d/%m/%Y} {date.replace(tzinfo=None).isoformat(timespec=digits).split('T')[1]}"


# --- Seaglider: a base station's dive file ---


def seaglider(
    path: Path, one: Flight, glider: int = 77, zero_counts: float = 2900.0, engine: str = "scipy", two: bool = False
) -> Path:
    """A dive file of the old format: one time base, classic NetCDF; or with a CTD on `two`, its own one."""
    import xarray

    c = one.columns
    rows, qc = "sg_data_point", np.full(len(one.t), b"1", dtype="S1")
    pressure = gsw.p_from_z(-c["depth_m"], LATITUDE)
    epoch = "seconds since 1970-1-1 00:00:00"
    variation = 7.0
    variables = {
        "time": (rows, one.t, {"units": epoch}),
        "ctd_time": (rows, one.t, {"units": epoch}),
        "eng_pitchAng": (rows, np.degrees(c["pitch_rad"]), {"units": "degrees"}),
        "eng_rollAng": (rows, np.degrees(c["roll_rad"]), {"units": "degrees"}),
        "eng_head": (rows, np.degrees(c["yaw_rad"]) - variation, {"units": "degrees"}),
        "eng_vbdCC": (rows, 1e6 * c["oil_m3"], {}),
        "eng_pitchCtl": (rows, -100.0 * c["battery_m"], {}),
        "ctd_pressure": (rows, pressure, {"units": "dbar"}),
        "temperature": (rows, c["temperature_c"], {"units": "degrees_Celsius"}),
        "salinity": (rows, np.full(len(one.t), SALINITY), {"units": "1e-3"}),
        "salinity_qc": (rows, qc, {}),
        "temperature_qc": (rows, qc, {}),
        "speed": (rows, np.full(len(one.t), 25.0), {"units": "cm/s"}),
        "magnetic_variation": ((), variation, {}),
        "avg_latitude": ((), LATITUDE, {"units": "degrees_north"}),
        "log_gps_time": ("gps_info", np.array([one.t[0] - 400.0, one.t[0] - 60.0, one.t[-1] + 90.0]), {"units": epoch}),
        "log_gps_lat": ("gps_info", LATITUDE + np.array([0.0, 0.0, NORTHWARD]), {"units": "degrees_north"}),
        "log_gps_lon": ("gps_info", np.full(3, LONGITUDE), {"units": "degrees_east"}),
        "log_C_VBD": ((), zero_counts, {}),
        "log_VBD_CNV": ((), -0.25, {}),
        "gc_st_secs": ("gc_event", [one.t[10]], {"units": epoch}),
        "gc_end_secs": ("gc_event", [one.t[12]], {"units": "seconds  since 1970-1-1 00:00:00"}),
        "gc_vbd_secs": ("gc_event", [9.0], {"units": "seconds"}),
    }
    if two:
        own = {
            "ctd_time": one.ctd_t, "ctd_pressure": one.pressure, "temperature": one.temperature,
            "salinity": gsw.SP_from_C(10.0 * one.conductivity, one.temperature, one.pressure),
            "salinity_qc": np.full(len(one.ctd_t), b"1"), "temperature_qc": np.full(len(one.ctd_t), b"1"),
        }  # fmt: skip
        variables |= {name: ("ctd_data_point", values, variables[name][2]) for name, values in own.items()}
    dataset = xarray.Dataset(variables, attrs={"glider": glider, "platform_id": f"SG{glider:03d}"})
    dataset.to_netcdf(path, engine=engine, format="NETCDF3_64BIT" if engine == "scipy" else None)
    return path


# --- OG1 ---


def og1(path: Path, flights: Iterable[Flight], model: str = "Seaglider M1 glider", numbered: bool = True) -> Path:
    """A mission in OG-1.0, its dives one behind the other."""
    import xarray

    flights = list(flights)
    rows = "N_MEASUREMENTS"

    def joined(name: str) -> np.ndarray:
        return np.concatenate([one.columns[name] for one in flights])

    t = np.concatenate([one.t for one in flights])
    depth = joined("depth_m")
    north = np.concatenate([[0.0, 0.0, *np.full(len(one.t) - 3, np.nan), NORTHWARD] for one in flights])  # by GPS
    variables = {
        "LATITUDE_GPS": (rows, LATITUDE + north, {"units": "degrees_north"}),
        "LONGITUDE_GPS": (rows, LONGITUDE + 0.0 * north, {"units": "degrees_east"}),
        "TIME": (rows, t, {"units": "seconds since 1970-01-01T00:00:00Z"}),
        "LATITUDE": (rows, np.full(len(t), LATITUDE), {"units": "degrees_north"}),
        "LONGITUDE": (rows, np.full(len(t), LONGITUDE), {"units": "degrees_east"}),
        "PITCH": (rows, np.degrees(joined("pitch_rad")), {"units": "degrees"}),
        "ROLL": (rows, np.degrees(joined("roll_rad")), {"units": "degrees"}),
        "HEADING": (rows, np.degrees(joined("yaw_rad")), {"units": "degrees"}),
        "PRES": (rows, gsw.p_from_z(-depth, LATITUDE), {"units": "dbar"}),
        "TEMP": (rows, joined("temperature_c"), {"units": "degrees_Celsius"}),
        "PSAL": (rows, np.full(len(t), SALINITY), {"units": "1e-3"}),
        "PSAL_QC": (rows, np.ones(len(t)), {}),
        "VBD_CC": (rows, 1e6 * joined("oil_m3"), {}),
        "DEPTH": (rows, depth, {"units": "m"}),
        "GLIDER_HORZ_VELO_MODEL": (rows, np.full(len(t), 25.0), {"units": "cm/s"}),
        "PLATFORM_MODEL": ((), model),
        "PLATFORM_SERIAL_NUMBER": ((), "sg077"),
    }
    if numbered:
        numbers = np.concatenate([np.full(len(one.t), n + 1) for n, one in enumerate(flights)])
        variables["divenum"] = (rows, numbers.astype(np.int32), {})
    xarray.Dataset(variables, attrs={"Conventions": "CF-1.10,OG-1.0"}).to_netcdf(path, engine="h5netcdf")
    return path


# --- Slocum ---

Sensors = dict[str, tuple[str, int, np.ndarray]]  # name: unit, bytes (1, 4 or 8), value by cycle, NaN: not logged


def slocum(folder: Path, one: Flight, name: str = "unit_7-2020-100-0-1", factored: bool = True) -> list[Path]:
    """Engineering and science binary of a segment, and their header caches where they are `factored`."""
    c, rows, north = one.columns, len(one.t), LATITUDE + NORTHWARD
    every = np.zeros(rows)
    engineering: Sensors = {
        "m_present_time": ("timestamp", 8, one.t),
        "m_pitch": ("rad", 4, c["pitch_rad"]),
        "m_roll": ("rad", 4, c["roll_rad"]),
        "m_heading": ("rad", 4, c["yaw_rad"] % (2.0 * np.pi)),
        "m_ballast_pumped": ("cc", 4, 1e6 * c["oil_m3"]),
        "m_is_ballast_pump_moving": ("bool", 1, c["pump"]),
        "m_battpos": ("in", 4, c["battery_m"] / 0.0254),
        "m_fin": ("rad", 4, c["fin_rad"]),
        "m_pressure": ("bar", 4, gsw.p_from_z(-c["depth_m"], LATITUDE) / 10.0),
        "m_gps_lat": ("lat", 8, np.array([*(every[1:] + degrees_minutes(LATITUDE)), degrees_minutes(north)])),
        "m_gps_lon": ("lon", 8, every + degrees_minutes(LONGITUDE)),
        "m_gps_mag_var": ("rad", 4, every + 0.125),
        "m_speed": ("m/s", 4, every + 0.3),
    } | {sensor: ("rad", 4, values) for sensor, values in one.extra.items()}
    science: Sensors = {
        "sci_m_present_time": ("timestamp", 8, one.ctd_t + 0.4),
        "sci_ctd41cp_timestamp": ("timestamp", 8, one.ctd_t),
        "sci_water_cond": ("s/m", 4, one.conductivity),
        "sci_water_temp": ("degc", 4, one.temperature),
        "sci_water_pressure": ("bar", 4, one.pressure / 10.0),
    }
    paths = []
    for kind, crc, sensors in (("dbd", "aaaa0001", engineering), ("ebd", "aaaa0002", science)):
        path = folder / f"{name.replace('-', '_')}.{kind}"
        data, cache = slocum_binary(sensors, f"{name}", kind, crc, factored)
        path.write_bytes(data)
        if factored:
            (folder / f"{crc}.cac").write_bytes(cache)
        paths.append(path)
    return paths


def compressed(path: Path) -> Path:
    """A binary as newer vehicles send it: blocks of 32 KiB packed by LZ4, each behind its length; .dcd for .dbd."""
    import lz4.block

    data = path.read_bytes()
    blocks = [lz4.block.compress(data[n : n + 32768], store_size=False) for n in range(0, len(data), 32768)]
    packed = path.with_suffix(f"{path.suffix[:2]}c{path.suffix[3:]}")
    packed.write_bytes(b"".join(struct.pack(">H", len(block)) + block for block in blocks))
    path.unlink()
    return packed


def slocum_binary(sensors: Sensors, name: str, kind: str, crc: str, factored: bool) -> tuple[bytes, bytes]:
    """The bytes of a binary, and its list of sensors, which is the header cache of a `factored` one."""
    state_bytes = -(-len(sensors) // 4)
    lines = [f"s: T {n:4d} {n:4d} {size} {one} {unit}\n" for n, (one, (unit, size, _)) in enumerate(sensors.items())]
    tags = {
        "dbd_label": "DBD(dinkum_binary_data)file", "encoding_ver": 5, "num_ascii_tags": 14, "all_sensors": "T",
        "the8x3_filename": "00010001", "full_filename": name, "filename_extension": kind, "mission_name": "OWN.MI",
        "fileopen_time": "Sun_Sep_13_12:26:40_2020", "total_num_sensors": len(sensors),
        "sensors_per_cycle": len(sensors), "state_bytes_per_cycle": state_bytes, "sensor_list_crc": crc.upper(),
        "sensor_list_factored": int(factored),
    }  # fmt: skip
    head = "".join(f"{tag}:    {value}\n" for tag, value in tags.items())
    cache = "".join(lines).encode("ascii")
    body = b"sa" + struct.pack(">hfd", 0x1234, 123.456, 123456789.12345)
    columns = [(size, np.asarray(values, dtype=float)) for _, size, values in sensors.values()]
    cycles = len(columns[0][1])
    for cycle in [0, *range(cycles)]:  # the first cycle stands twice: readers pass over it
        body += _cycle([(size, float(values[cycle])) for size, values in columns], state_bytes)
    return head.encode("ascii") + (b"" if factored else cache) + body + b"X", cache


def _cycle(values: list[tuple[int, float]], state_bytes: int) -> bytes:
    """One cycle: 'd', two bits of state a sensor (2: a new value, 0: none), and the new values."""
    states, data = 0, b""
    for size, value in values:
        states = states << 2 | (0 if np.isnan(value) else 2)
        if not np.isnan(value):
            data += struct.pack({1: ">b", 4: ">f", 8: ">d"}[size], int(value) if size == 1 else value)
    states <<= 2 * (4 * state_bytes - len(values))
    return b"d" + states.to_bytes(state_bytes, "big") + data
