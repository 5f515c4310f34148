"""Services of a simulated robot under `sim/`, with Gazebo's names and types. Each one runs inside the loop, between two cycles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from std_srvs.srv import Empty, EmptyResponse

from gazebo_msgs.srv import (
    ApplyBodyWrench,
    ApplyBodyWrenchResponse,
    BodyRequest,
    BodyRequestResponse,
    DeleteModel,
    DeleteModelResponse,
    GetLinkState,
    GetLinkStateResponse,
    SetModelConfiguration,
    SetModelConfigurationResponse,
    SpawnModel,
    SpawnModelResponse,
)
from hric_control import poses, urdf
from hric_control.errors import CommandError, HricError, UnknownNameError
from hric_control.hardware_interface import JointStates
from hric_control.joint_limits import JointLimits, load_limits
from hric_control.node import Node, Registration
from hric_control.plant import FloatArray, Plant
from hric_control.sim_loop import SimLoop
from hric_control.sim_topics import SimTopics
from hric_msgs.srv import StepSimulation, StepSimulationResponse

WORLD = ("", "world", "map")
"""Names of the inertial frame, as Gazebo accepts them."""


class SimulatedRobot(Protocol):
    """What a RobotHW must offer for these services."""

    loop: SimLoop
    plant: Plant
    states: JointStates
    description: str

    def reset(self, q: Sequence[float] | None = None) -> None:
        """Robot to q (its start by default), the world to its start; run time goes on. Inside the loop."""

    def set_configuration(self, q: Sequence[float]) -> None:
        """Robot to q at rest, the world left as it is, limiters reset, controllers restarted in the next cycle. Inside the loop."""


def serve(hw: SimulatedRobot, node: Node) -> SimServices:
    """Offer the services and topics below `<node>/sim`; `.unregister()` takes them back."""
    return SimServices(hw, node.child("sim"))


class SimServices:
    """The handlers. A refusal is `success: False` with the reason in `status_message`, or the service's error where the type has no such field.

    Args:
        hw: the simulated robot.
        node: namespace of the services.
    """

    def __init__(self, hw: SimulatedRobot, node: Node) -> None:
        self._hw, self._node, self._loop, self._plant = hw, node, hw.loop, hw.plant
        self._robot = urdf.parse(hw.description).get("name", "robot")
        self._limits: list[JointLimits] = load_limits(hw.description, None, hw.states.names, ("position",))
        self._waiting: list[tuple[float, str, Callable[[], None]]] = []
        self.topics = SimTopics(hw, node, self._robot)
        self._loop.after_cycle.append(self._start_waiting)
        loop = self._loop
        self._services: list[Registration] = [
            self._empty("reset_simulation", lambda: loop.request(self._reset)),
            self._empty("reset_world", lambda: loop.request(self._reset)),
            self._empty("pause_physics", loop.pause),
            self._empty("unpause_physics", loop.unpause),
            self._offer("step", StepSimulation, self._step),
            self._offer("set_model_configuration", SetModelConfiguration, self._told(SetModelConfigurationResponse, self._configure)),
            self._offer("apply_body_wrench", ApplyBodyWrench, self._told(ApplyBodyWrenchResponse, self._wrench)),
            self._offer("clear_body_wrenches", BodyRequest, self._clear_wrenches),
            self._offer("spawn_urdf_model", SpawnModel, self._told(SpawnModelResponse, self._spawn)),
            self._offer("delete_model", DeleteModel, self._told(DeleteModelResponse, self._delete)),
            self._offer("get_link_state", GetLinkState, self._link_state),
        ]

    def unregister(self) -> None:
        """Take the services and topics back."""
        for service in self._services:
            service.unregister()
        self._loop.after_cycle.remove(self._start_waiting)
        self.topics.unregister()

    def _offer(self, name: str, kind: type, handler: Callable[[Any], Any]) -> Registration:
        return self._node.service(name, kind, handler)

    def _empty(self, name: str, action: Callable[[], object]) -> Registration:
        def handler(_: Any) -> Any:
            action()
            return EmptyResponse()

        return self._offer(name, Empty, handler)

    def _told(self, response: Callable[..., Any], action: Callable[[Any], str]) -> Callable[[Any], Any]:
        """Handler that runs `action(request)` inside the loop and answers with its text, or the reason why not."""

        def handler(request: Any) -> Any:
            try:
                return response(success=True, status_message=self._loop.request(lambda: action(request)))
            except HricError as error:
                return response(success=False, status_message=str(error))

        return handler

    def _reset(self) -> None:
        self._waiting.clear()
        self._hw.reset()

    def _step(self, request: Any) -> Any:
        try:
            time = self._loop.step(request.steps)
        except HricError as error:
            return StepSimulationResponse(success=False, status_message=str(error), time=self._loop.time)
        return StepSimulationResponse(success=True, status_message=f"{request.steps} cycles done", time=time)

    def _configure(self, request: Any) -> str:
        if request.model_name not in ("", self._robot):
            raise UnknownNameError("model with joints", request.model_name, [self._robot])
        names, positions = list(request.joint_names), [float(value) for value in request.joint_positions]
        if not names or len(names) != len(positions) or len(set(names)) != len(names):
            raise CommandError(f"{len(names)} joint_names (all different, at least one) need as many joint_positions; got {len(positions)}")
        known = self._hw.states.names
        for name in names:
            if name not in known:
                raise UnknownNameError("joint", name, known, self._robot)
        poses.finite("joint_positions", *positions)
        # What is not named stays where it is.
        wanted = dict(zip(known, self._hw.states.position, strict=True)) | dict(zip(names, positions, strict=True))
        outside = [self._outside(limit, wanted[limit.name]) for limit in self._limits if limit.name in names]
        self._hw.set_configuration([wanted[name] for name in known])
        warning = "; ".join(text for text in outside if text)
        if warning:
            self._node.log_warn(f"set_model_configuration: {warning}")
        return f"{len(names)} joints set" + (f"; warning: {warning}" if warning else "")

    @staticmethod
    def _outside(limit: JointLimits, q: float) -> str:
        inside = limit.lower <= q <= limit.upper
        return "" if inside else f"{limit.name} at {q:g} {limit.unit} is outside its range [{limit.lower:g}, {limit.upper:g}]"

    def _frame(self, name: str) -> FloatArray:
        """T_world_frame, shape (4, 4), of a link or of the world itself."""
        return np.eye(4) if name in WORLD else self._plant.link_state(name)[0]

    def _wrench(self, request: Any) -> str:
        body, w, point = request.body_name, request.wrench, request.reference_point
        R = self._frame(request.reference_frame)[:3, :3]
        force = (R @ poses.finite("force", w.force.x, w.force.y, w.force.z)).tolist()
        torque = (R @ poses.finite("torque", w.torque.x, w.torque.y, w.torque.z)).tolist()
        at = poses.finite("reference_point", point.x, point.y, point.z)
        duration, start = request.duration.to_sec(), request.start_time.to_sec()
        self._plant.link_state(body)  # an unknown body is refused now, not when its time has come
        if duration == 0.0:
            return "duration is 0: nothing to apply (negative: until cleared)"
        span = f"for {duration:g} s" if duration > 0.0 else "until cleared"

        def apply() -> None:
            self._plant.apply_wrench(body, force, torque, at, duration if duration > 0.0 else -1.0)

        if start > self._loop.time:
            self._waiting.append((start, body, apply))
            return f"wrench on {body} from {start:g} s {span}"
        apply()
        return f"wrench on {body} {span}"

    def _start_waiting(self, time: float) -> None:
        """Begin the wrenches whose time has come; after a cycle, so that they act from the next step on."""
        if not self._waiting:
            return
        next_cycle = time + self._loop.time_step
        due = [apply for start, _, apply in self._waiting if start <= next_cycle + 1e-9]
        self._waiting = [entry for entry in self._waiting if entry[0] > next_cycle + 1e-9]
        for apply in due:
            try:
                apply()
            except HricError as error:
                self._node.log_error(f"apply_body_wrench: {error}")

    def _clear_wrenches(self, request: Any) -> Any:
        def clear() -> None:
            self._waiting = [entry for entry in self._waiting if request.body_name not in ("", entry[1])]
            self._plant.clear_wrenches(request.body_name or None)

        self._loop.request(clear)
        return BodyRequestResponse()

    def _spawn(self, request: Any) -> str:
        if not request.model_name or "::" in request.model_name:
            raise CommandError(f"model_name must be a name without '::'; got {request.model_name!r}")
        if request.model_name == self._robot:
            raise CommandError(f"model_name {request.model_name!r} is the robot's own")
        base = urdf.root_link(urdf.parse(request.model_xml))
        T = self._frame(request.reference_frame) @ poses.matrix(request.initial_pose)
        # A model whose root link is the world does not move, as in Gazebo.
        self._plant.spawn(request.model_name, request.model_xml, T, fixed=base == "world")
        return f"{request.model_name} spawned" + (", fixed" if base == "world" else "")

    def _delete(self, request: Any) -> str:
        self._plant.delete(request.model_name)
        return f"{request.model_name} deleted"

    def _link_state(self, request: Any) -> Any:
        response = GetLinkStateResponse()

        def look() -> None:
            T, twist = self._plant.link_state(request.link_name)
            T_world_ref = self._frame(request.reference_frame)
            R = T_world_ref[:3, :3]
            poses.fill(response.link_state.pose, np.linalg.inv(T_world_ref) @ T)
            poses.fill_twist(response.link_state.twist, np.concatenate([R.T @ twist[:3], R.T @ twist[3:]]))

        try:
            self._loop.request(look)
        except HricError as error:
            response.success, response.status_message = False, str(error)
            return response
        response.link_state.link_name, response.link_state.reference_frame = request.link_name, request.reference_frame or "world"
        response.success, response.status_message = True, f"state of {request.link_name} at {self._loop.time:.3f} s"
        return response
