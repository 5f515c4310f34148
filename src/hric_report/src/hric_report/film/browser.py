"""Headless Chromium, controlled by its DevTools protocol over a pipe; it renders in software, without a display."""

import base64
import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

from hric_core.errors import FailureError

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",  # it shows only pages that this workspace wrote, and root has no sandbox
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--mute-audio",
    "--remote-debugging-pipe",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
WAIT = 90.0
"""Time limit for a response of the browser, long enough for a busy machine [s]; project default."""


def program() -> str | None:
    """Return the path of Chromium; None: it is not installed."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


class BrowserError(FailureError):
    """Failure of the browser or of a script in its page."""


class Browser:
    """Process of Chromium with one page.

    Args:
        profile: folder for the browser's own files.

    Attributes:
        problems: errors and warnings of the page's console, and exceptions of its scripts.

    Raises:
        BrowserError: the browser is not installed, has ended or does not respond; all methods raise it.
    """

    def __init__(self, profile: Path) -> None:
        if (path := program()) is None:
            raise BrowserError("Chromium is not installed; run scripts/setup --with pictures, which installs it")
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()
        command = [path, *FLAGS, f"--user-data-dir={profile}", "--window-size=1400,1000", "about:blank"]
        redirect = f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}'
        self._process = subprocess.Popen(
            ["bash", "-c", redirect, "bash", *command],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._read, self._write, self._buffer, self._number = ours_in, ours_out, b"", 0
        self._session: str | None = None
        self._page = ""
        self.problems: list[str] = []
        try:
            targets = self.call("Target.getTargets")["targetInfos"]
            page = next(target["targetId"] for target in targets if target["type"] == "page")
            self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Log", "Network"):
                self.call(f"{domain}.enable")
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Stop the browser and all its processes."""
        with contextlib.suppress(BrowserError, subprocess.TimeoutExpired):
            self.call("Browser.close")
            self._process.wait(5)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self._read)
        os.close(self._write)

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self, path: Path) -> None:
        """Open an HTML file in the page, and wait until its scripts have run."""
        self.open_address(path.resolve().as_uri())

    def open_address(self, address: str) -> None:
        """Open an address in the page, and wait until its scripts have run."""
        self.problems.clear()
        self._page = address
        self.call("Page.navigate", url=address)
        self.wait("document.readyState === 'complete'")

    def wait(self, expression: str, timeout: float = WAIT) -> None:
        """Wait until a JavaScript expression is true in the page, at most `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while not self.evaluate(expression):
            if time.monotonic() > deadline:
                raise BrowserError(
                    f"after {timeout:g} s the page has not reached {expression}; its console: {self.problems}"
                )
            time.sleep(0.1)

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression in the page; for a promise, its result."""
        response = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in response:
            raise BrowserError(
                f"the page cannot execute {expression}: {json.dumps(response['exceptionDetails'])[:2000]}"
            )
        return response["result"].get("value")

    def screenshot(self) -> bytes:
        """Return the visible part of the page as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command of the DevTools protocol, such as Page.navigate, and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters} | (
            {"sessionId": self._session} if self._session else {}
        )
        self._send(json.dumps(message).encode() + b"\0")
        while (response := self._receive()).get("id") != self._number:
            self.on_event(response.get("method", ""), response.get("params", {}))
        if "error" in response:
            raise BrowserError(f"{method}: {response['error']}")
        result: dict[str, Any] = response["result"]
        return result

    def _send(self, data: bytes) -> None:
        try:
            while data:
                data = data[os.write(self._write, data) :]
        except OSError as error:
            raise BrowserError("the browser has ended") from error

    def _receive(self) -> dict[str, Any]:
        """Return the next message of the browser; if this is interrupted, the received part stays in the buffer."""
        deadline = time.monotonic() + WAIT
        while b"\0" not in self._buffer:
            if not select.select([self._read], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise BrowserError(f"the browser does not respond within {WAIT:g} s")
            part = os.read(self._read, 1 << 20)
            if not part:
                raise BrowserError("the browser has ended")
            self._buffer += part
        message, self._buffer = self._buffer.split(b"\0", 1)
        content: dict[str, Any] = json.loads(message)
        return content

    def on_event(self, method: str, values: dict[str, Any]) -> None:
        """Append the error or warning that a DevTools event reports, if any, to `problems`."""
        if method == "Runtime.exceptionThrown":
            details = values["exceptionDetails"]
            self.problems.append(details.get("exception", {}).get("description") or details["text"])
        elif method == "Runtime.consoleAPICalled" and values["type"] in ("error", "warning", "assert"):
            self.problems.append(" ".join(str(one.get("value", one.get("description"))) for one in values["args"]))
        elif method == "Log.entryAdded" and values["entry"]["level"] in ("error", "warning"):
            entry = values["entry"]
            if "GL Driver Message" not in entry["text"]:  # about the speed of drawing in software
                self.problems.append(f"{entry['text']} {entry.get('url', '')}")
