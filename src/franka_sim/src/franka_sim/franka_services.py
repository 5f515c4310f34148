"""Services that tell the arm what it cannot know: payload and frames. They never change the plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.transforms import FloatArray, check_transform
from franka_msgs.srv import SetEEFrame, SetEEFrameResponse, SetKFrame, SetKFrameResponse, SetLoad, SetLoadResponse
from hric_control.errors import HricError
from hric_control.node import Node, Registration
from hric_control.sim_loop import SimLoop


class ToldRobot(Protocol):
    """What a simulated arm must offer for these services."""

    loop: SimLoop
    model: KdlFrankaModel

    def tell(self, change: Callable[[KdlFrankaModel], None]) -> None:
        """Change what the model was told, inside the loop, and let the state show it."""


class FrankaServices:
    """`franka_control/set_load`, `set_EE_frame`, `set_K_frame`, on any Node. A refusal is success=False with the reason in `error`.

    Args:
        hw: the arm.
        root_node: the robot's namespace.
    """

    def __init__(self, hw: ToldRobot, root_node: Node) -> None:
        self._hw = hw
        node = root_node.child("franka_control")
        self._services: list[Registration] = [
            node.service("set_load", SetLoad, self._answer(SetLoadResponse, self._load)),
            node.service("set_EE_frame", SetEEFrame, self._answer(SetEEFrameResponse, self._ee_frame)),
            node.service("set_K_frame", SetKFrame, self._answer(SetKFrameResponse, self._k_frame)),
        ]

    def unregister(self) -> None:
        """Take the services back."""
        for service in self._services:
            service.unregister()

    def _answer(self, response: Callable[..., Any], make: Callable[[Any], Callable[[KdlFrankaModel], None]]) -> Callable[[Any], Any]:
        def handler(request: Any) -> Any:
            try:
                change = make(request)
                self._hw.loop.request(lambda: self._hw.tell(change))
            except HricError as error:
                return response(success=False, error=str(error))
            return response(success=True, error="")

        return handler

    @staticmethod
    def _load(request: Any) -> Callable[[KdlFrankaModel], None]:
        com: Sequence[float] = request.F_x_center_load
        inertia: Sequence[float] = request.load_inertia
        return lambda model: model.set_load(request.mass, com, inertia)

    @staticmethod
    def _ee_frame(request: Any) -> Callable[[KdlFrankaModel], None]:
        NE_T_EE: FloatArray = check_transform(request.NE_T_EE, "NE_T_EE")
        return lambda model: model.set_ee(model.F_T_NE @ NE_T_EE)

    @staticmethod
    def _k_frame(request: Any) -> Callable[[KdlFrankaModel], None]:
        EE_T_K: FloatArray = np.array(check_transform(request.EE_T_K, "EE_T_K"))
        return lambda model: model.set_stiffness_frame(EE_T_K)
