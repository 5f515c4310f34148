"""The node `calibrate`: pairs the tracked body with the robot's end effector, and saves where the mocap frame stands."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger, TriggerResponse

from franka_msgs.msg import FrankaState
from hric_control.errors import CommandError, HricError, ParameterError
from hric_control.node import Node
from hric_control.ros_node import RosNode
from hric_msgs.msg import MocapData
from mocap_natnet.calibration import Calibration, save
from mocap_natnet.codec.types import Vector
from mocap_natnet.parameters import MOCAP_FRAME
from mocap_natnet.poses import UP_AXES, z_up
from mocap_natnet.process import run

AVERAGED = 120
"""Frames that one point is the mean of; half a second at 240 Hz (our choice)."""
STILL = 0.002
"""A body that moves by more than this while it is looked at stands not still [m] (our choice)."""


class CalibrateNode:
    """Services `~add`, `~solve`, `~clear`.

    Args:
        node: private node.

    Raises:
        ParameterError: a parameter is not valid.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._lock = node, threading.Lock()
        self._body = str(node.param("body", ""))
        self._up = node.param("up_axis", "y")
        if self._up not in UP_AXES:
            raise ParameterError(f"{node.resolve('up_axis')} is {self._up!r}; valid: {', '.join(UP_AXES)}")
        self._base_frame = str(node.param("base_frame", "panda_link0"))
        self._path = Path(str(node.param("file", "base_from_mocap.yaml")))
        self._calibration = Calibration()
        self._recent: list[Vector] = []
        self._effector: Vector | None = None
        node.subscribe("/hric/perception/mocap", MocapData, self._on_mocap)
        node.subscribe(str(node.param("state_topic", "/franka_state_controller/franka_states")), FrankaState, self._on_state)
        for name, handler in (("add", self._add), ("solve", self._solve), ("clear", self._clear)):
            node.service(name, Trigger, lambda request, handler=handler: self._serve(handler))  # type: ignore[misc]

    def _on_mocap(self, message: Any) -> None:
        body = next((body for body in message.rigid_bodies if self._body in ("", body.name)), None)
        with self._lock:
            if body is None or not body.tracking_valid or message.header.frame_id != MOCAP_FRAME:
                self._recent.clear()
                return
            place = body.pose.position
            self._recent = [*self._recent[1 - AVERAGED :], z_up(self._up, (place.x, place.y, place.z))]

    def _on_state(self, message: Any) -> None:
        with self._lock:
            self._effector = (message.O_T_EE[12], message.O_T_EE[13], message.O_T_EE[14])  # column-major

    def _serve(self, handler: Any) -> Any:
        try:
            with self._lock:
                return TriggerResponse(True, handler())
        except HricError as error:
            return TriggerResponse(False, str(error))

    def _add(self) -> str:
        """Take a pair."""
        if self._effector is None:
            raise CommandError("the robot's state is not known: is state_topic right, does the robot run?")
        if len(self._recent) < AVERAGED:
            raise CommandError(
                f"the body was tracked for {len(self._recent)} of {AVERAGED} frames in frame {MOCAP_FRAME!r}: "
                "show it to the cameras, and run natnet_client without base_frame"
            )
        columns = list(zip(*self._recent, strict=True))
        if max(max(column) - min(column) for column in columns) > STILL:
            raise CommandError(f"the body moves by more than {1000 * STILL:g} mm: let it stand still")
        x, y, z = (sum(column) / len(column) for column in columns)
        self._calibration.add((x, y, z), self._effector)
        return f"{len(self._calibration.seen)} pairs"

    def _solve(self) -> str:
        """Fit and save."""
        pose, rms, each = self._calibration.solve()
        save(self._path, pose, self._base_frame, rms, len(each))
        listed = ", ".join(f"{1000 * residual:.2f}" for residual in each)
        text = f"root mean square residual {1000 * rms:.2f} mm (of each pair: {listed}); saved to {self._path.resolve()}"
        self._node.log_info(text)
        return text

    def _clear(self) -> str:
        """Begin anew."""
        self._calibration = Calibration()
        return "0 pairs"


def main(text: str) -> int:
    """Run the node until it is told to end.

    Args:
        text: for --help.
    """

    def make(private: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        CalibrateNode(private)
        return lambda: None, lambda: None

    return run("calibrate_mocap", text, make)
