"""Which vehicles of another form a blind test holds, what changes in them, and how much."""

from dataclasses import dataclass, replace

import numpy as np

from glider.sim_backend.foreign import foreign_layout as fo
from glider.tools.verify.challenge.forms import FORMS, Form
from glider.tools.verify.challenge.plan import NONE, SINGLE, UNKNOWN, Planned


@dataclass(frozen=True)
class FormCounts:
    """Vehicles of a blind test of another form."""

    changed: int = 30
    unchanged: int = 20
    outside: int = 10
    reference: int = 12  # healthy runs of each, with motion capture, that it is identified from

    @property
    def total(self) -> int:
        return self.changed + self.unchanged + self.outside


@dataclass(frozen=True)
class FormPlan(Planned):
    """One vehicle; its kind is NONE, SINGLE or UNKNOWN."""

    label: str | None
    mocap: bool  # of the later runs; the reference has it always


def _outside(label: str, element: str, entry: int, size: float, most: float) -> Form:
    return Form(label, tuple((part, place) for part, place in map(str.split, element.split(","))), (entry,), (size,),
                most, 0.0)  # fmt: skip


# Changes of a vehicle's body or devices that a label names. Drag grows by fouling; lift and weathercock are lost by
# wings and fin, and take no other sign. Labels whose form is a share of a coefficient are left out: there is none.
CHANGES = (
    replace(FORMS["drag"], most_negative=0.0, least=0.0),
    replace(FORMS["lift"], sizes=(-0.4,), most=2.2, most_negative=0.0, least=0.0),
    replace(FORMS["weathercock"], sizes=(-0.4,), most=2.2, most_negative=0.0, least=0.0),
    *(
        replace(FORMS[label], least=0.0)
        for label in (
            "tether", "roll_trim", "pitch_trim", "yaw_trim", "net_buoyancy", "ballast_scale", "ballast_leak",
            "cg_longitudinal", "cg_lateral", "cg_vertical", "slider_scale", "compressibility", "stratification",
            "servo_offset", "servo_slow", "servo_backlash", "slider_backlash", "slider_slow", "pump_slow",
            "pump_droop", "current", "current_shear", "imu_pitch_bias", "imu_roll_bias", "compass", "attitude_scale",
            "attitude_lag", "gyro_scale", "gyro_bias", "depth_offset", "depth_scale", "depth_lag", "pressure_lever",
            "command_delay", "mocap_delay", "clock_skew",
        )
    ),
)  # fmt: skip

# Outside the catalogue: water in a wing's shell that runs out, growth on one wing whose drag rises with the angle of
# attack, a loose mass that slides with the pitch, and those of the other sets that do not need coefficients.
OUTSIDE = (
    _outside("x_flooded_wing", "mass net,mass lateral", fo.FS_SHELL, 0.03, 5.0),
    _outside("x_fouled_wing", "hydrodynamics surge,hydrodynamics yaw", fo.FS_SIDED_FOULING, 2.0, 8.0),
    _outside("x_loose_mass", "mass longitudinal", fo.FS_LOOSE, 0.006, 5.0),
    *(FORMS[label] for label in ("x_pump_jet", "x_entanglement", "x_roll_pitch", "x_flapping_tail")),
)

BY_LABEL = {form.label: form for form in (*CHANGES, *OUTSIDE)}


def form_plan(seed: int, counts: FormCounts) -> list[FormPlan]:
    """The vehicles in their order; half of each kind with motion capture, those that need it among them."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 11]))
    plans: list[tuple[str, str | None, bool]] = []
    for kind, forms, count in ((SINGLE, CHANGES, counts.changed), (UNKNOWN, OUTSIDE, counts.outside)):
        turns = [forms[n] for _ in range(-(-count // len(forms))) for n in rng.permutation(len(forms))][:count]
        must = [form.by_mocap for form in turns]
        free = rng.permutation([n for n in range(count) if not must[n]])
        captured = {*free[: max(0, count // 2 - sum(must))].tolist(), *(n for n in range(count) if must[n])}
        plans += [(kind, form.label, n in captured) for n, form in enumerate(turns)]
    plans += [(NONE, None, n < counts.unchanged // 2) for n in range(counts.unchanged)]
    return [FormPlan(number, *plans[n]) for number, n in enumerate(rng.permutation(len(plans)))]
