"""A headless Chromium that a test drives: pages opened, clicked and typed at as a person does, widths and colours."""

import base64
import itertools
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--hide-scrollbars", "--remote-debugging-port=0", "--remote-allow-origins=*",
)  # fmt: skip
WAIT = 30.0  # s


class Page:
    """One page of the browser, by its debugging protocol."""

    def __init__(self, socket):
        self.socket, self.numbers = socket, itertools.count(1)

    def command(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a command; RuntimeError with what the browser says of one that failed."""
        number = next(self.numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self.socket.recv(timeout=WAIT))
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def value(self, expression: str) -> Any:
        """The value of an expression in the page; RuntimeError with what it throws."""
        answer = self.command("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def until(self, expression: str) -> Any:
        """The value of an expression as soon as it is true."""
        end = time.monotonic() + WAIT
        while not (found := self.value(expression)):
            assert time.monotonic() < end, f"never true: {expression}"
            time.sleep(0.05)
        return found

    def settle(self) -> None:
        """Wait until the page has been painted twice, and smooth scrolling has come to rest."""
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def view(self, width: int, height: int, dark: bool = False, media: str = "screen") -> None:
        """The size of the window in CSS pixels, and what the page is told of colours and medium."""
        self.command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )
        scheme = [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {"name": "prefers-reduced-motion", "value": "reduce"},
        ]
        self.command("Emulation.setEmulatedMedia", media=media, features=scheme)
        self.settle()

    def open(self, path: Path) -> None:
        """Load a file and wait for its end."""
        self.command("Page.navigate", url=path.as_uri())
        self.until("document.readyState === 'complete'")
        self.settle()

    def middle(self, selector: str) -> tuple[float, float]:
        """Middle of an element, which is scrolled into sight."""
        found = self.value(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); "
            "e.scrollIntoView({block: 'center', behavior: 'instant'});"
            " const r = e.getClientRects()[0]; return [r.left + r.width / 2, r.top + r.height / 2]; })()"
        )
        return found[0], found[1]

    def mouse(self, kind: str, x: float, y: float, count: int = 1, pressed: int = 0) -> None:
        button = "none" if kind == "mouseMoved" and not pressed else "left"
        self.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=count, buttons=pressed)

    def click(self, selector: str) -> None:
        """A click of the mouse in the middle of an element."""
        x, y = self.middle(selector)
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, pressed=1)
        self.mouse("mouseReleased", x, y)
        self.settle()

    def drag(self, selector: str, first: float, last: float) -> None:
        """A drag across an element, between shares of its width."""
        _, y = self.middle(selector)
        left, wide = self.value(
            f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            " return [r.left, r.width]; })()"
        )
        self.mouse("mouseMoved", left + first * wide, y)
        self.mouse("mousePressed", left + first * wide, y, pressed=1)
        for share in (0.5 * (first + last), last):
            self.mouse("mouseMoved", left + share * wide, y, pressed=1)
        self.mouse("mouseReleased", left + last * wide, y)
        self.settle()

    def key(self, key: str) -> None:
        """A key pressed and released, where the focus is."""
        for kind in ("keyDown", "keyUp"):
            self.command("Input.dispatchKeyEvent", type=kind, key=key)
        self.settle()

    def screenshot(self, path: Path, whole: bool = True) -> None:
        """The page as a PNG."""
        self.settle()
        shown = self.command("Page.captureScreenshot", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(shown["data"]))


@contextmanager
def browser(folder: Path) -> Iterator[Page]:
    """A page of a Chromium that keeps its profile in `folder`, and ends with the block."""
    from websockets.sync.client import connect

    assert CHROMIUM is not None
    port = folder / "DevToolsActivePort"
    with subprocess.Popen(
        [CHROMIUM, *OPTIONS, f"--user-data-dir={folder}", "about:blank"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            end = time.monotonic() + WAIT
            while not (port.is_file() and len(port.read_text().split()) == 2):
                assert time.monotonic() < end, "the browser never opened its port"
                time.sleep(0.05)
            number, path = port.read_text().split()
            with connect(f"ws://127.0.0.1:{number}{path}", max_size=None, proxy=None) as whole:
                targets = Page(whole).command("Target.getTargets")["targetInfos"]
            target = next(one["targetId"] for one in targets if one["type"] == "page")
            with connect(f"ws://127.0.0.1:{number}/devtools/page/{target}", max_size=None, proxy=None) as socket:
                yield Page(socket)
        finally:
            process.terminate()
