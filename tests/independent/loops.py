"""The loops a second time, for the tests: state space with Pade delays, put together by python-control.

Only the plant's matrices are shared with tools/study/tuning; wiring, delays, observer and closing are python-control's.
It and what it brings take a second to import, which every process of the tests would spend on collecting them: here,
and where else a test alone needs a large library, it is imported where it is used.
"""

import numpy as np

from glider.firmware.core.vehicle.layout import M_R, M_S, R_R, R_S, X_B
from glider.firmware.model.gains import Control
from glider.tools.study.tuning.linear_plant import Plant
from glider.tools.study.tuning.loops import Delays

ORDER = 4  # of the Pade approximation
REFERENCES = ["pitch_ref", "pitch_rate_ref", "depth_ref", "depth_rate_ref"]


def block(A, B, C, D, inputs, outputs):
    import control

    return control.ss(A, B, C, D, inputs=inputs, outputs=outputs)


def gain(row, inputs, output):
    return block([], [], [], [row], inputs, [output])


def late(delay, source, output):
    import control

    sys = control.ss(control.tf(*control.pade(delay, ORDER)))
    return block(sys.A, sys.B, sys.C, sys.D, [source], [output])


def pid(gains, error, rate, output):
    return block([[0.0]], [[1.0, 0.0]], [[gains.ki]], [[gains.kp, gains.kd]], [error, rate], [output])


def blocks(P: np.ndarray, plant: Plant, delays: Delays, gains: Control) -> list:
    """All blocks but the two wires from controller to actuator: slider_wanted, ballast_wanted are not connected."""
    wo = gains.depth.rate_bandwidth
    sr = P[M_R] * P[R_R] + P[M_S] * P[R_S]
    by_pitch = -sr / P[M_S] / np.cos(plant.trim.pitch) ** 2  # d(feedforward)/d(reference)
    return [
        block(plant.A, plant.B, plant.C, np.zeros((4, 2)), ["slider_cmd", "ballast_cmd"],
              ["pitch", "pitch_rate", "depth", "ballast"]),
        late(delays.imu, "pitch", "pitch_seen"),
        late(delays.imu, "pitch_rate", "pitch_rate_seen"),
        late(delays.beacon, "depth", "depth_sampled"),
        late(delays.plunger, "ballast", "ballast_seen"),
        block([[-2.0 * wo, 1.0], [-wo * wo, 0.0]], [[2.0 * wo], [wo * wo]], np.eye(2), np.zeros((2, 1)),
              ["depth_sampled"], ["depth_seen", "depth_rate_seen"]),
        gain([1.0, -1.0], ["pitch_seen", "pitch_ref"], "pitch_error"),
        gain([1.0, -1.0], ["pitch_rate_seen", "pitch_rate_ref"], "pitch_rate_error"),
        gain([-1.0, 1.0], ["depth_seen", "depth_ref"], "depth_error"),
        gain([-1.0, 1.0], ["depth_rate_seen", "depth_rate_ref"], "depth_rate_error"),
        pid(gains.pitch, "pitch_error", "pitch_rate_error", "pitch_pid"),
        pid(gains.depth, "depth_error", "depth_rate_error", "ballast_wanted"),
        gain([1.0, -P[X_B] / P[M_S], by_pitch], ["pitch_pid", "ballast_seen", "pitch_ref"], "slider_wanted"),
    ]  # fmt: skip


def wires(slider: float = 1.0, ballast: float = 1.0, further: dict[str, float] | None = None) -> list:
    """The two wires, with a gain each and, by name, a further delay."""
    made = []
    for name, factor in (("slider", slider), ("ballast", ballast)):
        delay = (further or {}).get(name, 0.0)
        if delay:
            made += [late(delay, f"{name}_wanted", f"{name}_late"), gain([factor], [f"{name}_late"], f"{name}_cmd")]
        else:
            made.append(gain([factor], [f"{name}_wanted"], f"{name}_cmd"))
    return made


def joined(parts: list, inputs: list[str], outputs: list[str]):
    import control

    return control.interconnect(
        parts, inplist=inputs, outlist=outputs, inputs=[f"in_{name}" for name in inputs],
        outputs=[f"out_{name}" for name in outputs], check_unused=False,
    )  # fmt: skip


def closed(P, plant, delays, gains, outputs=("pitch", "depth"), **wiring):
    """References to outputs, both loops closed."""
    return joined([*blocks(P, plant, delays, gains), *wires(**wiring)], REFERENCES, list(outputs))


def opened(P, plant, delays, gains, loop: str):
    """The loop gain of "pitch" or "depth" under negative feedback; the depth loop open while pitch is looked at."""
    parts = blocks(P, plant, delays, gains)
    if loop == "pitch":
        sys = joined(parts, ["slider_cmd"], ["slider_wanted"])
    else:
        sys = joined([*parts, wires()[0]], ["ballast_cmd"], ["ballast_wanted"])
    return -sys
