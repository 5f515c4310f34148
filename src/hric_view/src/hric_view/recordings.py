"""Pages of `hric view`: list of the recorded runs, replay of one or two of them, reports, and start of new runs."""

import contextlib
import json
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from hric_bags.run_file import RunFile
from hric_bags.run_folder import RunFolder
from hric_core.errors import HricError
from hric_report import html
from hric_report.html import templates, verdict
from hric_view import new_run, page
from hric_view.server import HTML, Visit, WebPage

KEPT = 3
"""Number of replays that stay in memory; project default, unconfirmed."""
NAMED = 5
"""Number of runs that the error message about an unknown run names."""


@dataclass(frozen=True)
class RunEntry:
    """Row of the list of runs.

    Attributes:
        name: name of the run folder.
        experiment, started, status: name of the experiment, start time and status, from run.yaml; "": not known.
        arguments: overrides of the experiment file, as on the command line.
        mode: "headless" or "live"; "": not known.
        verdict: outcome of `hric assess`, or the reason why there is none.
        fault: reason why the run cannot be replayed; "": it can.
    """

    name: str
    experiment: str = ""
    started: str = ""
    status: str = ""
    arguments: str = ""
    mode: str = ""
    verdict: str = ""
    fault: str = ""


def run_names(root: Path) -> list[str]:
    """Return the names of all run folders in the folder of runs, the newest first, without links such as `latest`."""
    changed = dict[str, float]()
    for path in root.glob("*/run.yaml"):
        with contextlib.suppress(FileNotFoundError):  # removed in the meantime
            if not path.parent.is_symlink():
                changed[path.parent.name] = path.stat().st_mtime
    return sorted(changed, key=changed.__getitem__, reverse=True)


def entry(folder: RunFolder) -> RunEntry:
    """Return the row of a run in the list; if the run cannot be read, the row has the reason in `fault`."""
    try:
        run = folder.read()
        outcome = _verdict(folder, run)
    except HricError as error:
        return RunEntry(folder.path.name, fault=str(error))
    values = {name: str(run.get(name) or "") for name in ("experiment", "started", "status", "mode")}
    words = run.get("arguments")
    values["arguments"] = " ".join(map(str, words)) if isinstance(words, list) else ""
    fault = "" if folder.bag_of(run).is_file() else "no bag: nothing was recorded, or the bag was removed"
    return RunEntry(folder.path.name, **values, verdict=outcome, fault=fault)


def _verdict(folder: RunFolder, run: RunFile) -> str:
    try:
        written = verdict.written(folder)
        if written is not None:
            return written["outcome"]
    except (OSError, LookupError, AttributeError, TypeError):  # of another program, or damaged
        return "not known: verdict.json cannot be read"
    definition = run.get("definition") or {}
    return "not known: not assessed yet" if definition.get("human") or definition.get("person") else "no person"


class RecordedWindow:
    """Pages on the recorded runs in a folder, which also start new runs.

    Args:
        root: folder of the runs.

    Attributes:
        new: pages that start a run, and receiver of the messages of viewers.
    """

    def __init__(self, root: Path) -> None:
        self._root, self._reading = root, threading.Lock()
        self.new = new_run.NewRun(root)
        self._scene = lru_cache(maxsize=KEPT)(_scene)

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page at an address: list of runs, replay of one or two runs, report, or start of a new run.

        Other addresses give None.

        Raises:
            HricError: there is no such run or experiment, or its report cannot be made.
        """
        if visit.path == new_run.PATH:
            return self.new.page(visit)
        if visit.path == "/":
            return self._list(visit)
        if visit.path == "/report":
            return self._report(self._folder(visit.query, "run"))
        if visit.path != "/run":
            return None
        names = self._names(visit.query)
        links = [
            ("all runs", visit.link("/")),
            *((f"report of {name}", visit.link("/report", run=name)) for name in names),
        ]
        return page.render(" and ".join(names), visit, links=links, waiting="reading the recording")

    def scene(self, visit: Visit) -> str:
        """Return the first message for a page: the replay of one or two runs, or the state of the run it has started.

        Raises:
            HricError: there is no such run, it cannot be read, or the motions of two runs do not match.
        """
        if "experiment" in visit.query:
            return json.dumps(self.new.state())
        folders = [RunFolder.open(self._root / name) for name in self._names(visit.query)]
        changed = tuple((str(folder.path), (folder.path / "run.yaml").stat().st_mtime_ns) for folder in folders)
        with self._reading:  # two at a time would only take each other's processor
            return self._scene(changed)

    def _names(self, query: Mapping[str, str]) -> list[str]:
        """Return the names of the one or two runs in a query (keys `run` and `other`)."""
        return [self._folder(query, key).path.name for key in ("run", "other") if key == "run" or key in query]

    def _folder(self, query: Mapping[str, str], key: str) -> RunFolder:
        names, name = run_names(self._root), query.get(key, "")
        if name not in names:
            newest = ", ".join(names[:NAMED]) or "none"
            raise HricError(f"there is no run {name!r} in {self._root}; the newest runs: {newest}")
        return RunFolder(self._root / name)

    def _list(self, visit: Visit) -> WebPage:
        entries = [entry(RunFolder(self._root / name)) for name in run_names(self._root)]
        template = templates.environment(page.ASSETS).get_template("runs.html")
        text = template.render(
            title="Recorded runs", subtitle=str(self._root), entries=entries, link=visit.link, token=visit.token
        )
        return WebPage(HTML, text.encode())

    def _report(self, folder: RunFolder) -> WebPage:
        path = folder.path / html.NAME
        with self._reading:
            if not path.is_file():
                html.write(folder)
        return WebPage(HTML, path.read_bytes())


def _scene(changed: Sequence[tuple[str, int]]) -> str:
    """Return the first message for the replay of one or two runs, as JSON.

    Args:
        changed: run folder and time of the last change of run.yaml [ns] of each; a changed run is read again.
    """
    folders = [RunFolder(Path(path)) for path, _ in changed]
    contents: Any = html.page_of(*folders) if len(folders) == 1 else html.comparison_of(folders)
    return page.scene_message(contents.robots, notes=contents.notes, live=False)
