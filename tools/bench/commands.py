"""What can be typed at the bench: one method a command; its docstring is its help, its first line the short one."""

import time

from glider.hal.protocols.vn100 import TextMessage, Vn100Decoder, encode_text
from glider.tools.bench.changing import Changing
from glider.tools.bench.client import BenchError
from glider.tools.bench.desk import UsageError, number
from glider.tools.bench.looking import Looking


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
        method = getattr(self, f"do_{words[0]}", None)
        if method is None:
            raise UsageError(f"no command '{words[0]}'; `help` lists them")
        try:
            method(*words[1:])
        except TypeError as error:
            if "positional argument" not in str(error):
                raise
            usage = (method.__doc__ or "").splitlines()[0]
            raise UsageError(f"usage: {usage}") from None

    def do_help(self, name: str = "") -> None:
        """help [COMMAND]: what can be typed."""
        if name:
            method = getattr(self, f"do_{name}", None)
            if method is None:
                raise UsageError(f"no command '{name}'")
            self.say("\n".join(line.strip() for line in (method.__doc__ or "").strip().splitlines()))
            return
        for item in self.names():
            self.say("  " + (getattr(self, f"do_{item}").__doc__ or "").splitlines()[0])

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
        if self.ask("limits do not hold for raw bytes; send them? (yes/no) ").lower() not in ("y", "yes"):
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
        """quit: stop the actuators and leave."""
        raise SystemExit(0)
