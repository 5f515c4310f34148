"""Services that press the user stop and the guiding button of an emulated Franka arm."""

from collections.abc import Callable
from typing import Any

from std_srvs.srv import SetBool, SetBoolResponse

from franka_sim.box.requests import RequestOutcome
from hric_core.node import Node, Registration

Press = Callable[[bool], RequestOutcome]
"""Function that presses (True) or releases (False) a button of the arm."""
InLoop = Callable[[Callable[[], RequestOutcome]], RequestOutcome]
"""Function that runs another one between two cycles of the arm and returns its result."""


class Buttons:
    """Services `franka_control/set_user_stop` and `franka_control/set_guiding` of an emulated arm, std_srvs/SetBool.

    On a real arm a person presses these buttons, so that the services exist for emulated arms only.

    Args:
        node: node that offers the services.
        namespace: absolute namespace of the arm's services.
        user_stop: function that presses or releases the user stop.
        guiding: function that presses or releases the guiding button.
        request: function that runs one of these between two cycles of the arm, and returns its result.
    """

    def __init__(self, node: Node, namespace: str, user_stop: Press, guiding: Press, request: InLoop) -> None:
        self._open: list[Registration] = [
            node.service(f"{namespace}/{name}", SetBool, _handler(press, request))
            for name, press in (("set_user_stop", user_stop), ("set_guiding", guiding))
        ]

    def unregister(self) -> None:
        """Unregister the services."""
        while self._open:
            self._open.pop().unregister()


def _handler(press: Press, request: InLoop) -> Callable[[Any], Any]:
    def handler(message: Any) -> Any:
        outcome = request(lambda: press(message.data))
        done = outcome is RequestOutcome.SUCCESS
        return SetBoolResponse(success=done, message="" if done else outcome.value)

    return handler
