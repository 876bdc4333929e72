"""The bench's commands that move actuators, and stop them."""

import time
from typing import Any

from glider.tools.bench import record, sweep
from glider.tools.bench.client import BenchError, check_actuator
from glider.tools.bench.desk import Desk, number
from glider.tools.bench.units import UNITS, from_port, to_port

MOVE_LIMIT_S = 30.0
AS_SHOWN = 0.005  # deg, mm: limits are shown to two places, and what is shown may be typed


class Moving(Desk):
    """enable, disable, stop, reset, goto, jog, sweep. What moves is confirmed first; a stop never is."""

    def do_enable(self) -> None:
        """enable: let actuators move; nothing does before. At a terminal it asks whether hands are clear."""
        if not self.scripted and not self.ask_yes("actuators will move when commanded; hands and cables clear?"):
            raise BenchError("not enabled")
        self.bench.ask("enable", on=True)
        self.say("enabled: actuators move when commanded")

    def do_disable(self) -> None:
        """disable: stop, and move no more."""
        self.bench.ask("enable", on=False)
        self.say("disabled")

    def do_stop(self) -> None:
        """stop: stop all actuators at once (so does Ctrl-C, and any key while something moves)."""
        self.bench.stop()
        self.say("stopped")

    def do_reset(self) -> None:
        """reset: forget a stall or alarm, after you have looked."""
        self.bench.ask("reset")

    def do_goto(self, actuator: str, position: str) -> None:
        """goto ACTUATOR POSITION: move there (servo deg, slider mm, ballast mm of plunger) and wait.

        A position outside the limits is refused; `limits` shows them.
        """
        self._move(check_actuator(actuator), number(position))

    def do_jog(self, actuator: str, step: str) -> None:
        """jog ACTUATOR STEP: move by so much from where it is (deg, mm)."""
        check_actuator(actuator)
        item = self.bench.snapshot()
        target = item["actuators"][actuator]["target"]
        here = self.bench.place(actuator, item)
        if target is not None:
            here = from_port(actuator, target, item["kg_per_m"])
        self._move(actuator, here + number(step))

    def _move(self, name: str, goal: float) -> float:
        unit, (low, high) = UNITS[name], self.bench.limits(name)
        if not low - AS_SHOWN <= goal <= high + AS_SHOWN:
            raise BenchError(f"{name}: {goal:g} {unit} is outside {low:.2f} to {high:.2f} {unit}; it stays where it is")
        sent = self.bench.target(name, goal)
        there = self.bench.wait_there(name, sent, MOVE_LIMIT_S, self.pressed)
        where = self.bench.place(name)
        self.say(f"{name}: at {where:.2f} {unit}" + ("" if there else f", not at {sent:.2f}"))
        if not there:
            raise BenchError(f"{name} did not get to {sent:.2f} {unit} within {MOVE_LIMIT_S:g} s")
        return where

    def do_sweep(self, actuator: str, low: str = "", high: str = "") -> None:
        """sweep ACTUATOR [LOW HIGH]: travel time, lag, backlash, dead band; run data and a picture.

        Without LOW and HIGH over 80 % of the way between the limits. Any key stops it.
        """
        check_actuator(actuator)
        state = self.bench.snapshot()
        limits = self.bench.limits(actuator, state)
        ends = tuple(sweep.TRAVEL_SHARE * end for end in limits) if not low else (number(low), number(high or "x"))
        if not limits[0] <= ends[0] < ends[1] <= limits[1]:
            raise BenchError(f"expected LOW < HIGH within {limits[0]:.2f} to {limits[1]:.2f} {UNITS[actuator]}")
        result = sweep.SweepResult(actuator, UNITS[actuator], *ends)
        the_plan = sweep.plan(ends[0], ends[1], self._speed(actuator))
        self.say(f"sweeping {actuator} from {ends[0]:.1f} to {ends[1]:.1f} {UNITS[actuator]}, {the_plan.seconds:.0f} s")
        rows = self._run_profile(actuator, the_plan, state["kg_per_m"])
        self._finish_sweep(result, the_plan, rows, state["kg_per_m"])

    def _speed(self, actuator: str) -> float:
        """What an actuator can do, by the vehicle's file, in deg/s or mm/s."""
        from glider.tools.data.sources import load_vehicle

        vehicle: Any = load_vehicle(self.bench.vehicle)
        kg_per_m = self.bench.snapshot()["kg_per_m"]
        return from_port(actuator, getattr(vehicle.actuators, actuator).rate, kg_per_m)

    def _run_profile(self, actuator: str, the_plan: sweep.SweepPlan, kg_per_m: float) -> list:
        self.bench.ask("record", on=True)
        try:
            steps = [(t, actuator, to_port(actuator, value, kg_per_m)) for t, value in the_plan.targets]
            self.bench.ask("profile", steps=steps)
            begin = time.monotonic()
            while (now := time.monotonic() - begin) < the_plan.seconds:
                self.note(f"sweeping {actuator}: {now:.0f} of {the_plan.seconds:.0f} s, {the_plan.part(now)}")
                if self.pressed():
                    self.bench.stop()
                    raise BenchError("stopped")
                try:
                    self.bench.raise_trouble(actuator, self.bench.snapshot()["actuators"][actuator])
                except BenchError:
                    self.bench.stop()
                    raise
                time.sleep(0.1)
        finally:
            self.note("")
            rows = self.bench.ask("record", on=False)
        return rows

    def _finish_sweep(self, result: sweep.SweepResult, the_plan: sweep.SweepPlan, rows: list, kg_per_m: float) -> None:
        data = record.table(rows)
        name, unit = result.actuator, result.unit
        columns = {"servo": (1, 8), "slider": (2, 6), "ballast": (3, 7)}[name]
        scale = from_port(name, 1.0, kg_per_m)
        times, command, position = data[:, 0], *(scale * data[:, column] for column in columns)
        folder = record.free_folder(self.out, f"sweep-{name}")
        run = record.write_case(folder, data, self.bench.vehicle)
        if name == "servo":
            self.say("servo: it knows nothing of its shaft; the run data have the roll that follows")
        else:
            sweep.analyse(result, the_plan, times, command, position)
            self.say(f"travel time {result.travel_s:.2f} s ({result.speed:.1f} {unit}/s), lag {result.lag_s:.3f} s")
            self.say(
                f"backlash {result.backlash:.3f} {unit}, dead band {result.dead_band:g} {unit}, "
                f"reading's noise {result.noise:.3f} {unit}"
            )
        sweep.picture(folder / f"sweep-{name}.png", result, times, command, position)
        self.say(f"{run}, {folder / f'sweep-{name}.png'}")
