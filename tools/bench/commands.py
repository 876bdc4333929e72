"""What can be typed at the bench: one method a command; its docstring is its help, its first line the short one."""

import inspect
import shutil
import textwrap
import time
from collections.abc import Callable

from glider.hal.protocols.vn100 import TextMessage, Vn100Decoder, encode_text
from glider.tools.bench.changing import Changing
from glider.tools.bench.client import BenchError
from glider.tools.bench.desk import UsageError, number
from glider.tools.bench.looking import Looking
from glider.tools.data.spelling import did_you_mean

ALIASES = {"?": "help", "exit": "quit"}


class Commands(Looking, Changing):
    """All commands: those that look, move and change the board file, and what is below them."""

    @classmethod
    def names(cls) -> list[str]:
        return sorted(name.removeprefix("do_") for name in dir(cls) if name.startswith("do_"))

    def run(self, line: str) -> None:
        """One line; BenchError says why it could not be done, SystemExit ends the console."""
        words = line.split("#")[0].split()
        if not words:
            return
        method = self._method(words[0])
        try:
            method(*words[1:])
        except TypeError as error:
            if "positional argument" not in str(error):
                raise
            usage = (method.__doc__ or "").splitlines()[0]
            raise UsageError(f"usage: {usage}") from None

    def _method(self, name: str) -> Callable[..., None]:
        """The method of a command that was typed; UsageError where there is none."""
        known = self.names()
        if (name := ALIASES.get(name, name)) not in known:
            raise UsageError(f"no command '{name}'; `help` lists them{did_you_mean(name, known)}")
        method: Callable[..., None] = getattr(self, f"do_{name}")
        return method

    def do_help(self, name: str = "") -> None:
        """help [COMMAND]: what can be typed; `?` for short."""
        width = min(shutil.get_terminal_size((100, 24)).columns, 110) - 1
        if name:
            words = inspect.cleandoc(self._method(name).__doc__ or "")
            self.say("\n".join(textwrap.fill(part, width) for part in words.split("\n\n")))
            return
        for item in self.names():
            line = "  " + (getattr(self, f"do_{item}").__doc__ or "").splitlines()[0]
            self.say(textwrap.fill(line, width, subsequent_indent="      ", break_on_hyphens=False))

    def do_raw(self, port: str, *data: str) -> None:
        """raw PORT BYTES...: hex bytes to a port, after a confirmation; on Modbus lines the check sum is added.

        A text command of the IMU goes as it is: `raw imu VNRRG,01`. Limits do not hold for what is sent here.
        """
        if port not in self.bench.snapshot()["ports"]:
            raise UsageError(f"no port '{port}'; there are {', '.join(self.bench.snapshot()['ports'])}")
        if not data:
            raise UsageError("usage: raw PORT BYTES...")
        text = " ".join(data)
        if text.startswith("VN"):
            raw = encode_text(text).hex()
        else:
            try:
                raw = bytes.fromhex(text).hex()
            except ValueError:
                raise UsageError(f"expected hex bytes, got '{text}'") from None
        if not self.ask_yes("limits do not hold for raw bytes; send them?"):
            raise BenchError("not sent")
        answer = bytes.fromhex(self.bench.ask("raw", port=port, data=raw))
        messages = [item for item in Vn100Decoder().feed(answer) if isinstance(item, TextMessage)]
        if messages:
            self.say("\n".join(f"${item.header},{','.join(item.fields)}" for item in messages))
            return
        answer = answer[:64]
        printable = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in answer)
        self.say(f"{answer.hex(' ') or 'nothing came'}  {printable}")

    def do_wait(self, seconds: str) -> None:
        """wait SECONDS: for scripts."""
        end = time.monotonic() + number(seconds)
        while time.monotonic() < end and not self.pressed():
            time.sleep(min(0.05, max(0.0, end - time.monotonic())))

    def do_quit(self) -> None:
        """quit: stop the actuators and leave; so do `exit` and Ctrl-D."""
        raise SystemExit(0)
