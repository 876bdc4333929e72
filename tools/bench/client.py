"""The console's side of the worker: starts it, asks it, keeps it knowing that someone is there."""

import json
import math
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

from glider.hal.ports import ACTUATORS
from glider.hal.spawn import module_command, module_environment
from glider.tools.bench.units import from_port, to_port
from glider.tools.data.errors import InputError
from glider.tools.data.spelling import did_you_mean

BEAT_S = 0.5
THERE, STANDS = 0.3, 0.03  # mm from the goal; mm in 0.1 s
PATIENCE_S = 1.0  # with a device that does not answer, before a move is given up
SERVO_S = 0.5  # for the servo to get anywhere


class BenchError(Exception):
    """A command could not be done; str() is what the person reads."""


class Bench:
    """A board at the bench. A context manager; leaving it stops the actuators."""

    def __init__(self, text: str, source: str, kind: str, vehicle: str, path: Path | None):
        self.text, self.source, self.kind, self.vehicle, self.path = text, source, kind, vehicle, path
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._trouble_since: dict[str, float] = {}
        self._asked = 0

    # --- the process ------------------------------------------------------------------------------------------------
    def __enter__(self) -> "Bench":
        self._start()
        threading.Thread(target=self._beat, daemon=True).start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.set()
        self._end()

    def _start(self) -> None:
        self._process = subprocess.Popen(
            module_command("glider.tools.bench.worker"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            start_new_session=True, env=module_environment(),
        )  # fmt: skip
        config = {"text": self.text, "source": self.source, "kind": self.kind, "vehicle": self.vehicle}
        answer = self._exchange(config)
        if "error" in answer:
            raise InputError(answer["error"], source=self.source)

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.close()
        process.wait(10.0)
        process.stdout.close()

    def restart(self, text: str) -> None:
        """Go on with a changed board file; actuators are stopped and not enabled any more."""
        with self._lock:
            self._end()
            self.text = text
            self._start()

    def _exchange(self, request: dict) -> dict:
        """The answer to a request. One before it that a Ctrl-C broke off is answered too, and passed over."""
        process = self._process
        if process is None:
            raise BenchError("the bench is closed")
        assert process.stdin is not None
        assert process.stdout is not None
        self._asked += 1
        number = self._asked
        try:
            process.stdin.write(json.dumps({**request, "number": number}).encode() + b"\n")
            process.stdin.flush()
            while line := process.stdout.readline():
                answer = self._answer_to(number, line)
                if answer is not None:
                    return answer
        except (BrokenPipeError, ValueError):
            pass
        raise BenchError("the process that holds the ports is gone; actuators hold what they were sent last")

    @staticmethod
    def _answer_to(number: int, line: bytes) -> dict | None:
        """An answer, where it is to that request; None for another's, and for what is left of a line broken off."""
        try:
            answer = json.loads(line)
        except json.JSONDecodeError:
            return None
        return answer if answer.pop("number") == number else None

    def _beat(self) -> None:
        while not self._closing.wait(BEAT_S):
            try:
                self.ask("beat")
            except BenchError:
                return

    def ask(self, verb: str, **arguments: Any) -> Any:
        """One request; its answer, or BenchError."""
        with self._lock:
            answer = self._exchange({"do": verb, **arguments})
        if "error" in answer:
            raise BenchError(answer["error"])
        return answer["ok"]

    # --- what commands use ------------------------------------------------------------------------------------------
    def snapshot(self) -> dict:
        return self.ask("snapshot")

    def stop(self) -> None:
        self.ask("stop")

    def limits(self, name: str, state: dict | None = None) -> tuple[float, float]:
        """An actuator's limits as a person reads them."""
        state = state or self.snapshot()
        low, high = (from_port(name, end, state["kg_per_m"]) for end in state["actuators"][name]["limits"])
        return low, high

    def target(self, name: str, value: float) -> float:
        """Send an actuator somewhere (deg, mm); where it is really sent."""
        kg_per_m = self.snapshot()["kg_per_m"]
        return from_port(name, self.ask("target", actuator=name, value=to_port(name, value, kg_per_m)), kg_per_m)

    def place(self, name: str, state: dict | None = None) -> float:
        """Where an actuator is (deg, mm): by its draw-wire, the servo by its command."""
        state = state or self.snapshot()
        item = state["actuators"][name]
        value = item.get("measured", item["target"] or 0.0)
        return from_port(name, value, state["kg_per_m"])

    def raise_trouble(self, name: str, item: dict) -> None:
        """BenchError for a fault that stays, at once, and for any other trouble that has lasted PATIENCE_S."""
        now = time.monotonic()
        if not item["error"]:
            self._trouble_since.pop(name, None)
        elif item.get("fault") or now - self._trouble_since.setdefault(name, now) > PATIENCE_S:
            self._trouble_since.pop(name, None)
            raise BenchError(f"{name}: {item['error']}")

    def wait_there(self, name: str, goal: float, timeout_s: float, interrupted: Any = None) -> bool:
        """Until the actuator is at its goal (deg, mm) or stands; False where it did not get there."""
        end, before = time.monotonic() + timeout_s, math.inf
        while time.monotonic() < end:
            if interrupted is not None and interrupted():
                self.stop()
                raise BenchError("stopped")
            state = self.snapshot()
            item = state["actuators"][name]
            self.raise_trouble(name, item)
            if name == "servo":
                time.sleep(SERVO_S)
                return True
            here = from_port(name, item["position"], state["kg_per_m"])
            if abs(here - goal) <= THERE and abs(here - before) <= STANDS:
                return True
            before = here
            time.sleep(0.1)
        return False


def check_actuator(name: str) -> str:
    if name not in ACTUATORS:
        raise BenchError(f"no actuator '{name}'; there are {', '.join(ACTUATORS)}{did_you_mean(name, ACTUATORS)}")
    return name
