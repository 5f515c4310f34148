"""Page of `hric try`: sliders, replay of the run with their values, and its figures next to those of the last run."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from hric_core.errors import HricError
from hric_view import page
from hric_view.server import ForeignMessageError, Viewer, Visit, WebPage
from hric_view.tryout import SLIDERS, Tryout, checked


class TryoutWindow:
    """Contents of the window of `hric try`, and receiver of the conditions that its viewers choose.

    Args:
        tryout: worker process that runs the experiment.
    """

    def __init__(self, tryout: Tryout) -> None:
        self._tryout = tryout

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page with the sliders; None: another address than "/"."""
        if visit.path != "/":
            return None
        sliders = [asdict(slider) for slider in SLIDERS]
        return page.render("Try a contact", visit, sliders=sliders, waiting="running the experiment for the first time")

    def scene(self, visit: Visit) -> str:
        """Return the message of the run with the default conditions, or the reason why this run failed."""
        try:
            return self._tryout.result({})
        except HricError as error:
            return json.dumps({"type": "refused", "text": str(error)})

    def receive(self, viewer: Viewer, message: Mapping[str, Any]) -> None:
        """Run the experiment with the conditions in a viewer's message, and send them the result."""
        if set(message) != {"command", "values"} or message["command"] != "run":
            raise ForeignMessageError(f"no command of this page; keys of the message: {', '.join(message)}")
        if not isinstance(message["values"], dict):
            raise ForeignMessageError("`values` must be a mapping")
        viewer.send(self._tryout.result(checked(message["values"])))

    def leave(self, viewer: Viewer) -> None:
        """Do nothing: no result is sent to a viewer who has disconnected."""
