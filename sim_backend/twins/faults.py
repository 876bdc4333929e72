"""Faults on demand: what a device's twin can do wrong."""

from dataclasses import dataclass

# name -> what its number means; None: it takes none
FAULTS: dict[str, str | None] = {
    "none": None,            # well again
    "silent": None,          # hears, does not answer
    "late": "s",             # answers so much later
    "wrong_id": None,        # answers in another device's name
    "bad_crc": None,         # answers with a broken check sum
    "nan": None,             # answers NaN where it speaks in floats
    "exception": "code",     # answers every request with this exception
    "stuck": None,           # a sensor repeats itself; an actuator is jammed
    "noise": "share",        # so many of its answers come with noise bytes around them
    "babble": None,          # sends noise at line rate, without end
    "unplug": None,          # the port is gone
}  # fmt: skip


class FaultError(ValueError):
    """A fault that cannot be; str() says which there are."""


@dataclass
class TwinFault:
    """What a device does wrong now."""

    kind: str = "none"
    value: float = 0.0


def parse_fault(text: str) -> TwinFault:
    """`late 0.2` or `silent` as a Fault."""
    kind, *rest = text.split()
    if kind not in FAULTS:
        raise FaultError(f"no fault '{kind}'; there are {', '.join(FAULTS)}")
    meaning = FAULTS[kind]
    if meaning is None and rest:
        raise FaultError(f"'{kind}' takes no number")
    if meaning is None:
        return TwinFault(kind)
    try:
        (value,) = (float(item) for item in rest)
    except ValueError:
        raise FaultError(f"'{kind}' takes one number: {meaning}") from None
    if not 0.0 <= value <= 255.0:
        raise FaultError(f"'{kind}': expected 0 to 255, got {value:g}")
    return TwinFault(kind, value)
