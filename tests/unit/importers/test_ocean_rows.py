"""Rows of ocean gliders: times of the mission, spikes, holes, two clocks; and a NetCDF file that is cut."""

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.data.importers.ocean.netcdf import NetCDF
from glider.tools.data.importers.ocean.segment import DAY, at_rows, clean, clock_offset, in_the_mission, require_unit
from tests.support.ocean_files import START, flight, og1, seaglider


def test_times_outside_the_mission_are_taken_out_and_counted():
    t = START + 5.0 * np.arange(50)
    t[3], t[10], t[20], t[30], t[40] = np.nan, 0.0, START + 400.0 * DAY, t[5], t[39]
    left_out: dict[str, int] = {}
    rows = in_the_mission(t, left_out)
    assert left_out == {"without a time": 1, "at a time outside the mission": 2, "whose time does not go on": 2}
    assert (np.diff(t[rows]) > 0.0).all()
    assert len(rows) == 45
    assert not set(rows) & {3, 10, 20, 30}


def test_no_time_at_all_leaves_no_row():
    left_out: dict[str, int] = {}
    assert in_the_mission(np.full(4, np.nan), left_out).size == 0
    assert left_out == {"without a time": 4}


@pytest.mark.parametrize(
    ("name", "spike"), [("depth_m", 40.0), ("pressure", -31.0), ("temperature", 9.0), ("conductivity", 1.5)]
)
def test_a_spike_is_taken_out_and_its_neighbours_are_not(name, spike):
    t = 4.0 * np.arange(60)
    values = 3.0 + 0.05 * t  # nothing in the sea, but what a sensor may give
    values = np.minimum(values, 8.0) if name == "conductivity" else values
    damaged = values.copy()
    damaged[30] += spike
    left_out: dict[str, int] = {}
    found = clean(name, t, damaged, left_out)
    assert np.flatnonzero(np.isnan(found)).tolist() == [30]
    assert left_out == {f"spike of {name}": 1} or list(left_out.values()) == [1]  # out of all bounds, or a spike
    assert (found[np.isfinite(found)] == values[np.isfinite(found)]).all()


def test_a_step_is_no_spike_and_a_steep_dive_neither():
    t = 20.0 * np.arange(40)
    for values in (np.where(t < 400.0, 20.0, 9.0), 1.0 * np.abs(t - 400.0)):
        left_out: dict[str, int] = {}
        assert np.isfinite(clean("pressure", t, values, left_out)).all()
        assert left_out == {}


def test_what_cannot_be_is_taken_out():
    left_out: dict[str, int] = {}
    found = clean("pitch_rad", np.arange(4.0), np.array([0.1, 2.0, np.nan, -0.2]), left_out)
    assert np.isnan(found).tolist() == [False, True, True, False]
    assert left_out == {"pitch_rad outside -1.571 to 1.571": 1}


def test_samples_are_interpolated_over_short_holes_alone():
    t = np.array([0.0, 10.0, 20.0, 50.0, 60.0])
    rows = np.array([-1.0, 0.0, 5.0, 20.0, 30.0, 50.0, 60.0, 61.0])
    found = at_rows(t, 2.0 * t, rows, 15.0)
    np.testing.assert_allclose(found, [np.nan, 0.0, 10.0, 40.0, np.nan, 100.0, 120.0, np.nan])
    assert np.isnan(at_rows(t, np.full(5, np.nan), rows, 15.0)).all()


@pytest.mark.parametrize("shift", [-120.0, -33.0, 47.5, 200.0])
def test_a_clock_that_is_off_is_found(shift):
    one = flight(rows=400, deepest=100.0)
    found = clock_offset(one.t, one.columns["depth_m"], one.ctd_t - shift, one.pressure / 1.01)
    assert found == pytest.approx(shift, abs=0.5)


def test_a_clock_that_is_right_and_a_vehicle_that_stays_say_nothing():
    one = flight(rows=400, deepest=100.0)
    assert clock_offset(one.t, one.columns["depth_m"], one.ctd_t, one.pressure / 1.01) is None
    still = np.full(len(one.t), 3.0)
    assert clock_offset(one.t, still, one.ctd_t, one.pressure) is None


def test_a_unit_is_the_one_asked_for():
    assert require_unit("dbar", {"dbar": 1.0}, "a.nc", "PRES") == 1.0
    with pytest.raises(InputError, match=r"a.nc: PRES: .*'bar', .*dbar"):
        require_unit("bar", {"dbar": 1.0}, "a.nc", "PRES")


def test_a_file_of_either_kind_is_refused_wherever_it_is_cut(tmp_path):
    whole = [seaglider(tmp_path / "p0770001.nc", flight()), og1(tmp_path / "m.nc", [flight()])]
    for path in whole:
        data, cut = path.read_bytes(), tmp_path / "cut.nc"
        for share in (0.0, 0.001, 0.02, 0.3, 0.5, 0.9, 0.999):
            cut.write_bytes(data[: int(share * len(data))])
            with pytest.raises(InputError, match=r"cut.nc: "):
                NetCDF(cut)


def test_a_classic_file_twice_in_one_counts_once(tmp_path):
    path = seaglider(tmp_path / "p0770001.nc", flight())
    data = path.read_bytes()
    twice = tmp_path / "twice.nc"
    twice.write_bytes(data + data)
    assert NetCDF(twice).size("sg_data_point") == 120
