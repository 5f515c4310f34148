"""The browser of films, and what only tests ask of it: network requests, printing, theme and processor time."""

import base64
import os
from pathlib import Path
from typing import Any

from hric_report.film import browser


def installed() -> bool:
    """Return whether Chromium is installed."""
    return browser.program() is not None


class Browser(browser.Browser):
    """One browser with one page.

    Attributes:
        requests: addresses that were asked for, beside the page itself.
    """

    def __init__(self, profile: Path) -> None:
        self.requests: list[str] = []
        super().__init__(profile)

    def __enter__(self) -> "Browser":
        return self

    def open_address(self, address: str) -> None:
        self.requests.clear()
        super().open_address(address)

    def pdf(self) -> bytes:
        """Return the page printed to PDF."""
        return base64.b64decode(self.call("Page.printToPDF", printBackground=True)["data"])

    def emulate(self, **features: str) -> None:
        """Set media features, e.g. scheme="dark"."""
        self.call(
            "Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": features["scheme"]}]
        )

    def processor(self) -> float:
        """Return the processor time of all processes of the browser so far [s]."""
        parents, times = {}, {}
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = path.read_text().rpartition(")")[2].split()
            except OSError:  # it ended meanwhile
                continue
            parents[int(path.parent.name)] = int(fields[1])
            times[int(path.parent.name)] = sum(map(int, fields[11:15]))  # of its own, and of children that ended
        ours = {self._process.pid}
        while more := {one for one, parent in parents.items() if parent in ours} - ours:
            ours |= more
        return sum(times[one] for one in ours) / os.sysconf("SC_CLK_TCK")

    def on_event(self, method: str, values: dict[str, Any]) -> None:
        super().on_event(method, values)
        if method == "Network.requestWillBeSent":
            address = values["request"]["url"]
            if address != self._page and not address.startswith(("blob:", "data:")):  # its own
                self.requests.append(address)
