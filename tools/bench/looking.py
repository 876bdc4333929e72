"""The bench's commands that look: nothing moves, nothing is written."""

import math

from glider.tools.bench.client import BenchError
from glider.tools.bench.desk import Desk, UsageError, number
from glider.tools.bench.units import UNITS, from_port, shown_values
from glider.tools.data.spelling import did_you_mean


class Looking(Desk):
    """read, watch, health."""

    def do_read(self, device: str = "") -> None:
        """read [DEVICE]: the newest values; fails where a device named has none that is valid."""
        state = self.bench.snapshot()
        known = [*state["sensors"], *state["actuators"]]
        if device and device not in known:
            raise UsageError(f"no device '{device}'; there are {', '.join(known)}{did_you_mean(device, known)}")
        for name in [device] if device else known:
            self.say(f"{name:<13} {self.describe(name, state)}")
        if device in state["sensors"] and state["sensors"][device]["validity"] != "valid":
            raise BenchError(f"{device}: {state['sensors'][device]['validity']}")
        if device in state["actuators"] and not state["actuators"][device]["answers"]:
            raise BenchError(f"{device}: does not answer")

    def describe(self, name: str, state: dict) -> str:
        """A device's line."""
        if name in state["sensors"]:
            item = state["sensors"][name]
            text = f"{item['validity']:<8} {shown_values(name, item['values'])}"
            if item["reading"] is not None:
                text += f"  (reads {item['reading']:g})"
        else:
            item, kg = state["actuators"][name], state["kg_per_m"]
            target = "-" if item["target"] is None else f"{from_port(name, item['target'], kg):.2f}"
            text = f"{'answers' if item['answers'] else 'SILENT':<8} target {target} {UNITS[name]}"
            if "position" in item:
                places = [from_port(name, item[key], kg) for key in ("position", "measured")]
                text += f", drive {places[0]:.2f}, wire {places[1]:.2f}, {item['counts']:.10g} counts"
            elif item["pulse_us"] is not None:
                text += f", pulse {item['pulse_us']:.2f} us"
        return text + (f"  [{item['error']}]" if item["error"] else "")

    def do_watch(self, seconds: str = "") -> None:
        """watch [SECONDS]: a live table of everything, until a key is pressed."""
        self._show(self.bench.snapshot, number(seconds) if seconds else math.inf)

    def do_health(self) -> None:
        """health: ports, lines, counts of what went wrong."""
        state = self.bench.snapshot()
        for name, port in state["ports"].items():
            where = "open" if port["up"] else f"NOT OPEN: {port['trouble']}"
            self.say(f"port {name:<9} {where}, {port['bytes_in']} bytes in, opened {port['opened']} times")
        for name, bus in state["buses"].items():
            self.say(f"line {name:<9} " + ", ".join(f"{key} {value}" for key, value in bus.items() if value))
        for name, item in {**state["sensors"], **state["actuators"]}.items():
            if item["error"] or item["timeouts"]:
                self.say(f"{name:<14} {item['timeouts']} timeouts {item['error']}")
