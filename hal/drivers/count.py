"""Counts of drives and encoders, by their register map.

A count is read whole or, while a late reply could be mistaken for that, by the block that holds its low word.
"""

from glider.hal.protocols.modbus import Request
from glider.hal.protocols.registers import LOW, WORDS, RegisterMap, step_of, value_of


class Count:
    """A count in a device's registers.

    `requests` are what a Poll asks, the whole number first. `value` is the newest count: a whole number unless the
    register map scales it.
    """

    def __init__(self, device: int, registers: RegisterMap):
        low, whole, self._name = LOW[registers.role]
        self._low, self._whole = registers.block[low], registers.block[whole]
        self.requests = [registers.read(device, whole), registers.read(device, low)]
        self.value = 0.0
        part = self._low.value[self._name]
        is_part = WORDS[part.type] < WORDS[self._whole.value[self._name].type]
        self._span = 65_536 * step_of(part) if is_part else 0.0

    def take(self, request: Request | None, registers: list[int]) -> float:
        """Take the reply to one of `requests` (None: the whole number) and return the count."""
        if request is not self.requests[1]:
            self.value = value_of(self._whole, self._name, registers)
        else:
            part = value_of(self._low, self._name, registers)
            self.value = unwrap_low_word(part, self.value, self._span) if self._span else part
        return self.value


def unwrap_low_word(part: float, last: float, span: float = 65_536) -> float:
    """Return the number nearest to `last` that differs from `part` by a multiple of `span`."""
    return last + (part - last + span / 2) % span - span / 2
