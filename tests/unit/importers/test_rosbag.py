"""Bags written by the rosbags library come in with their frames, units and clocks; a cut one is named with its byte."""

import math
from pathlib import Path

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.tools.data.errors import InputError
from glider.tools.data.importers.rosbag import read_rosbag
from glider.tools.data.importers.streams import import_streams
from glider.tools.data.runs.case import load_case
from glider.tools.own.cases import import_target, own_vehicle
from glider.tools.own.runs import load_own_runs
from glider.tools.own.skeleton import write_skeleton

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

RATE, SECONDS, START = 50.0, 20.0, 1_764_000_000
MAP = """
format = 1
vehicle = "roughie"
water_density_kg_m3 = 1000.0
rate_hz = 10.0
max_gap_s = 0.3

[columns.roll_rad]
topic = "/imu/data"
field = "orientation.roll"
unit = "rad"

[columns.pitch_rad]
topic = "/imu/data"
field = "orientation.pitch"
unit = "rad"

[columns.yaw_rad]
topic = "/imu/data"
field = "orientation.yaw"
unit = "rad"

[columns.q_rad_s]
topic = "/imu/data"
field = "angular_velocity.y"
unit = "rad/s"
sign = -1

[columns.depth_m]
topic = "/pressure"
field = "fluid_pressure"
unit = "Pa"
zero = 101325.0

[columns.mocap_z_m]
topic = "/odometry"
field = "pose.pose.position.z"
unit = "m"
sign = -1

[columns.cmd_slider_m]
topic = "/joints"
field = "position[slider]"
unit = "mm"
"""


def attitude(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Roll, pitch, yaw in NED axes, rad, of the made vehicle."""
    return 0.1 * np.sin(0.5 * t), -0.4 + 0.1 * np.cos(0.3 * t), 0.7 + 0.02 * t


def quaternion_enu(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """x, y, z, w of a body with y left and z up in ENU, by products of matrices, not by angles."""
    from scipy.spatial.transform import Rotation

    to_ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    body = np.diag([1.0, -1.0, -1.0])
    ned = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    return tuple(Rotation.from_matrix(to_ned.T @ ned @ body).as_quat().tolist())


def write_bag(path: Path, plugin) -> None:
    """A bag of an IMU at 50 Hz, pressure and odometry at 10 Hz, joint states at 1 Hz, each with its stamp."""
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    T = store.types
    V, Q, Header = (T[f"geometry_msgs/msg/{n}"] for n in ("Vector3", "Quaternion")), None, T["std_msgs/msg/Header"]
    V, Q = V
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        kinds = {
            "/imu/data": "sensor_msgs/msg/Imu", "/pressure": "sensor_msgs/msg/FluidPressure",
            "/odometry": "nav_msgs/msg/Odometry", "/joints": "sensor_msgs/msg/JointState",
        }  # fmt: skip
        to = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}

        def send(topic: str, t: float, make) -> None:
            ns = round(t * 1e9)
            stamp = T["builtin_interfaces/msg/Time"](sec=START + ns // 10**9, nanosec=ns % 10**9)
            message = make(Header(stamp=stamp, frame_id="base"))
            late = START * 10**9 + ns + 40_000_000  # recorded 40 ms after the stamp
            writer.write(to[topic], late, store.serialize_cdr(message, kinds[topic]))

        zero9, zero36 = np.zeros(9), np.zeros(36)
        for n in range(int(RATE * SECONDS)):
            t = n / RATE
            q = Q(*quaternion_enu(*(float(a[0]) for a in attitude(np.array([t])))))
            send("/imu/data", t, lambda head, q=q: T[kinds["/imu/data"]](
                head, q, zero9, V(0.0, -0.25, 0.0), zero9, V(0.0, 0.0, 9.81), zero9))  # fmt: skip
            if n % 5 == 0:
                pressure = 101325.0 + 9806.65 * (1.0 + 0.1 * t)
                send("/pressure", t, lambda head, p=pressure: T[kinds["/pressure"]](head, p, 0.0))
                point = T["geometry_msgs/msg/Point"](0.0, 0.0, -1.0 - 0.1 * t)
                pose = T["geometry_msgs/msg/PoseWithCovariance"](T["geometry_msgs/msg/Pose"](point, q), zero36)
                still = T["geometry_msgs/msg/Twist"](V(0.0, 0.0, 0.0), V(0.0, 0.0, 0.0))
                twist = T["geometry_msgs/msg/TwistWithCovariance"](still, zero36)
                send("/odometry", t, lambda head, a=pose, b=twist: T[kinds["/odometry"]](head, "base", a, b))
            if n % 50 == 0:
                joints = np.array([0.0, 10.0 * (n // 50 % 2)])
                send("/joints", t, lambda head, j=joints: T[kinds["/joints"]](
                    head, ["rail", "slider"], j, np.zeros(0), np.zeros(0)))  # fmt: skip


@pytest.fixture(scope="module", params=["SQLITE3", "MCAP"])
def bag(request, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("bags") / f"dive-{request.param.lower()}"
    write_bag(path, rosbag2.StoragePlugin[request.param])
    return path


@pytest.fixture
def mapping(tmp_path) -> str:
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    return str(path)


def test_a_bag_becomes_a_case(bag, mapping, tmp_path):
    import_streams([bag], mapping, tmp_path / "case", read_rosbag)
    run = load_case(tmp_path / "case").runs[0]
    roll, pitch, yaw = attitude(run.t)
    inside = slice(1, -1)
    for name, truth in (("roll_rad", roll), ("pitch_rad", pitch), ("yaw_rad", yaw)):
        assert np.allclose(run.columns[name][inside], truth[inside], atol=5e-4), name
    assert np.allclose(run.columns["q_rad_s"], 0.25)
    assert np.allclose(run.columns["depth_m"][inside], 1.0 + 0.1 * run.t[inside], atol=1e-4)
    assert np.allclose(run.columns["mocap_z_m"][inside], 1.0 + 0.1 * run.t[inside], atol=1e-6)
    assert np.array_equal(run.columns["cmd_slider_m"], 0.01 * (np.floor(run.t + 1e-9) % 2))
    assert run.start_utc == "2025-11-24T16:00:00.000Z"
    assert math.isclose(run.t[-1], SECONDS - 0.02, abs_tol=0.1)


OWN = """
format = 1
vehicle = "mine.toml"
rate_hz = 10.0
max_gap_s = 0.3
[columns.thrust_n]
topic = "/joints"
field = "position[slider]"
[columns.rudder_rad]
topic = "/joints"
field = "position[rail]"
[columns.depth_m]
topic = "/odometry"
field = "pose.pose.position.z"
sign = -1
[columns.yaw_rad]
topic = "/imu/data"
field = "orientation.yaw"
"""


def test_a_bag_becomes_a_case_of_a_model_of_ones_own(bag, tmp_path):
    write_skeleton(tmp_path / "mine.toml")
    (tmp_path / "map.toml").write_text(OWN)
    into = import_target(str(tmp_path / "map.toml"))
    import_streams([bag], str(tmp_path / "map.toml"), tmp_path / "case", read_rosbag, into=into)
    vehicle = own_vehicle(tmp_path / "case", None)
    assert vehicle is not None
    (run,) = load_own_runs(tmp_path / "case", vehicle.declared)
    inside = slice(1, -1)
    assert np.array_equal(run.inputs[:, 0], 10.0 * (np.floor(run.t + 1e-9) % 2))
    assert np.allclose(run.outputs[inside, 0], 1.0 + 0.1 * run.t[inside], atol=1e-6)
    assert np.allclose(run.outputs[inside, 1], attitude(run.t)[2][inside], atol=5e-4)
    assert np.isnan(run.outputs[:, 2]).all()
    (tmp_path / "map.toml").write_text(OWN.replace("sign = -1", 'unit = "Pa"'))
    with pytest.raises(ConfigError, match="water_density_kg_m3: missing key, which depth_m needs"):
        import_streams([bag], str(tmp_path / "map.toml"), tmp_path / "no", read_rosbag, into=into)


def test_times_may_be_those_of_recording(bag, tmp_path):
    (tmp_path / "map.toml").write_text('time = "receipt"\n' + MAP)
    import_streams([bag], str(tmp_path / "map.toml"), tmp_path / "case", read_rosbag)
    assert load_case(tmp_path / "case").runs[0].start_utc == "2025-11-24T16:00:00.040Z"


def test_a_cut_bag_is_named_with_its_byte(bag, mapping, tmp_path):
    (file,) = (one for one in bag.iterdir() if one.suffix in (".db3", ".mcap"))
    data, cut = file.read_bytes(), tmp_path / "cut"
    cut.mkdir()
    (cut / "metadata.yaml").write_bytes((bag / "metadata.yaml").read_bytes())
    for share in (0.3, 0.7, 0.999):
        end = int(share * len(data))
        (cut / file.name).write_bytes(data[:end])
        with pytest.raises(InputError, match=rf"{file.name}: cut.* {end}\b"):
            import_streams([cut], mapping, tmp_path / "case", read_rosbag)
    assert not (tmp_path / "case").exists()


def test_a_message_that_cannot_be_read_is_named_by_its_number(mapping, tmp_path):
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with rosbag2.Writer(tmp_path / "bag", version=9) as writer:
        to = writer.add_connection("/pressure", "sensor_msgs/msg/FluidPressure", typestore=store)
        writer.write(to, 10**18, b"\x00\x01\x00\x00\x01")
    with pytest.raises(InputError, match=r"bag: message 1 .*/pressure"):
        import_streams([tmp_path / "bag"], mapping, tmp_path / "case", read_rosbag)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("/pressure", "/depth", r"depth_m: .*'/depth'; .* /imu/data, /joints, /odometry, /pres"),
        ("fluid_pressure", "pressure", r"message \d+ of the mapped topics, /pressure .* has no number 'pressure'"),
        ("[slider]", "[rudder]", r"/joints .*: has no number 'position\[rudder\]'"),
        ("angular_velocity.y", "angular velocity", r"not a field: 'angular velocity'"),
    ],
)
def test_a_wrong_mapping_is_said(bag, tmp_path, old, new, said):
    (tmp_path / "map.toml").write_text(MAP.replace(old, new))
    with pytest.raises(InputError, match=said):
        import_streams([bag], str(tmp_path / "map.toml"), tmp_path / "case", read_rosbag)


def test_what_is_no_bag_is_said(mapping, tmp_path):
    for name, said in (("none", "no such file"), ("folder", "no metadata.yaml"), ("log.txt", "expected a bag's")):
        path = tmp_path / name
        if name == "folder":
            path.mkdir()
        elif name == "log.txt":
            path.write_text("no bag")
        with pytest.raises(InputError, match=said):
            import_streams([path], mapping, tmp_path / "case", read_rosbag)
