"""Pages that start a run: the list of experiments, and the form of one with the progress of its run."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hric_core.errors import HricError
from hric_report.html import templates
from hric_run.definition import experiment
from hric_view import experiment_form, page
from hric_view.run_process import RunProcess
from hric_view.server import HTML, ForeignMessageError, Viewer, Visit, WebPage

PATH = "/new"


class NewRun:
    """Pages of `hric view` that start a run, and receiver of their messages.

    A page can only choose an experiment of the workspace, and numbers and words for its parameters. The robot of the
    experiment must be simulated, and a page cannot change it.

    Args:
        root: folder of the runs.
    """

    def __init__(self, root: Path) -> None:
        self._process = RunProcess(root)

    def page(self, visit: Visit) -> WebPage:
        """Return the page with the list of experiments, or the form of the experiment that the address names.

        Raises:
            HricError: there is no such experiment, or its file has a mistake.
        """
        name = visit.query.get("experiment")
        if name is None:
            return _page(
                "experiments.html",
                title="New run",
                subtitle="",
                rows=[
                    (one, experiment.read(one).get("description", ""), experiment_form.hindrance(one))
                    for one in experiment.names()
                ],
                link=visit.link,
                state=self._process.state,
            )
        return _page(
            "new_run.html",
            title=f"New run of {name}",
            fields=experiment_form.fields(name),
            subtitle=experiment.read(name).get("description", ""),
            hindrance=experiment_form.hindrance(name),
            file=experiment.find(name).read_text(),
            connect=visit.socket,
            link=visit.link,
            name=name,
        )

    def state(self) -> dict[str, Any]:
        """Return the state of the last run that a page has started, as a message for the pages."""
        return {"type": "state", **vars(self._process.state)}

    def receive(self, viewer: Viewer, message: Mapping[str, Any]) -> None:
        """Execute the command in a message of a viewer: state, check, run or cancel; see server.Receiver."""
        match message:
            case {"command": "state"} if len(message) == 1:
                pass
            case {"command": "cancel"} if len(message) == 1:
                self._process.cancel()
            case {"command": "check" | "run", "experiment": str(name), "values": dict(values)} if len(message) == 3:
                words = experiment_form.words(name, values)
                if message["command"] == "check":
                    experiment.load(name, words)
                    viewer.tell({"type": "checked", "line": shlex.join(self._process.command(name, words))})
                    return
                if reason := experiment_form.hindrance(name):
                    raise HricError(reason)
                self._process.start(name, words)
            case _:
                raise ForeignMessageError(f"no command of this page; keys of the message: {', '.join(message)}")
        viewer.tell(self.state())

    def leave(self, viewer: Viewer) -> None:
        """Do nothing: a run continues when its viewers disconnect."""

    def close(self) -> None:
        """Cancel the run, and wait for its end."""
        self._process.close()


def _page(template: str, **values: Any) -> WebPage:
    return WebPage(HTML, templates.environment(page.ASSETS).get_template(template).render(**values).encode())
