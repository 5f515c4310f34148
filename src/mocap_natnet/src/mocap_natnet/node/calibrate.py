"""Node `calibrate`: fits the pose of the mocap frame to positions of a tracked body on the robot's end effector."""

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger, TriggerResponse

from franka_msgs.msg import FrankaState
from hric_core.errors import CommandError, HricError
from hric_core.geometry import Vector
from hric_core.geometry.poses import z_up
from hric_core.node import Node
from hric_core.parameters import Settings, text
from hric_core.ros.process import NodeApp
from hric_msgs.msg import MocapData
from mocap_natnet.node.parameters import MOCAP_FRAME, UP_AXIS
from mocap_natnet.tracking.calibration import FrameCalibration, save

AVERAGED = 120
"""Number of mocap frames averaged for one point; half a second at 240 Hz (project default, unconfirmed)."""
STILL = 0.002
"""Largest motion with which the tracked body counts as at rest [m] (project default, unconfirmed)."""


@dataclass(frozen=True)
class CalibrateSettings(Settings):
    """Parameters of the node `calibrate`."""

    body: str = text("", figures=True, text="rigid body on the end effector; empty: the first of the stream")
    up_axis: str = UP_AXIS
    base_frame: str = text("panda_link0", text="name of the base frame, which is written into the file")
    file: str = text(
        "base_from_mocap.yaml",
        text="file to write, with parameters of `natnet_client`; load it with `rosparam load FILE /natnet_client`",
    )
    state_topic: str = text("franka_state_controller/franka_states", text="topic of the robot's state")


class CalibrateNode(NodeApp):
    """Node that calibrates the pose of the mocap frame in the robot's base by the services `~add`, `~solve`, `~clear`.

    Args:
        node: private node.

    Raises:
        ParameterError: a parameter is not valid.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._lock = node, threading.Lock()
        settings = CalibrateSettings.read(node)
        self._body, self._up, self._base_frame = settings.body, settings.up_axis, settings.base_frame
        self._path = Path(settings.file)
        self._calibration = FrameCalibration()
        self._recent: list[Vector] = []
        self._effector: Vector | None = None
        node.subscribe(node.beside("hric/perception/mocap"), MocapData, self._on_mocap)
        node.subscribe(node.beside(settings.state_topic), FrankaState, self._on_state)
        for name, handler in (("add", self._add), ("solve", self._solve), ("clear", self._clear)):
            node.service(name, Trigger, lambda request, handler=handler: self._serve(handler))  # type: ignore[misc]
        name = node.namespace
        node.log_info(f"call the service {name}/add at each pose, with the arm at rest, and {name}/solve at the end")

    def _on_mocap(self, message: Any) -> None:
        body = next((body for body in message.rigid_bodies if self._body in ("", body.name)), None)
        with self._lock:
            if body is None or not body.tracking_valid or message.header.frame_id != MOCAP_FRAME:
                self._recent.clear()
                return
            p = body.pose.position
            self._recent = [*self._recent[1 - AVERAGED :], z_up(self._up, (p.x, p.y, p.z))]

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
        """Add a pair of points: mean position of the tracked body, and position of the end effector in the base."""
        if self._effector is None:
            raise CommandError("the robot's state is not known: check that the robot runs, and state_topic")
        if len(self._recent) < AVERAGED:
            raise CommandError(
                f"the body was tracked for {len(self._recent)} of {AVERAGED} frames in tf frame {MOCAP_FRAME!r}: "
                "show it to the cameras, and run natnet_client without base_frame"
            )
        columns = list(zip(*self._recent, strict=True))
        if max(max(column) - min(column) for column in columns) > STILL:
            raise CommandError(f"the body moves by more than {1000 * STILL:g} mm: hold it still")
        x, y, z = (sum(column) / len(column) for column in columns)
        self._calibration.add((x, y, z), self._effector)
        return f"{len(self._calibration.seen)} pairs"

    def _solve(self) -> str:
        """Fit the pose of the mocap frame to all pairs, and save it."""
        pose, rms, each = self._calibration.solve()
        save(self._path, pose, self._base_frame, rms, len(each))
        listed = ", ".join(f"{1000 * residual:.2f}" for residual in each)
        text = (
            f"root mean square residual {1000 * rms:.2f} mm (of each pair: {listed}); saved to {self._path.resolve()}"
        )
        self._node.log_info(text)
        return text

    def _clear(self) -> str:
        """Remove all pairs."""
        self._calibration = FrameCalibration()
        return "0 pairs"
