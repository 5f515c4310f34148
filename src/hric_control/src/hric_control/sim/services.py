"""Services of a simulated robot in the namespace `sim`, with the names and types of Gazebo.

They are executed in the control loop's thread, between two cycles."""

from collections.abc import Callable
from typing import Any

import numpy as np
from std_srvs.srv import Empty

from gazebo_msgs.srv import ApplyBodyWrench, BodyRequest, DeleteModel, GetLinkState, SetModelConfiguration, SpawnModel
from hric_control.limits import JointLimits, load_limits
from hric_control.plant import FloatArray
from hric_control.robot_hw import RobotHW
from hric_control.sim.sim_loop import LIVE_FACTOR
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_control.sim.topics import SimTopics
from hric_core.errors import CommandError, HricError, check_known
from hric_core.geometry import messages, pose_of_transform, stamped
from hric_core.geometry.transforms import inverse
from hric_core.node import Node
from hric_core.urdf import read
from hric_msgs.srv import SetRealTimeFactor, StepSimulation

WORLD = ("", "world", "map")
"""Accepted names of the world frame, as in Gazebo."""


class SimServices:
    """Services and topics of a simulated robot in the namespace `<node>/sim`.

    The response to a refused request has `success` false and the reason in `status_message`; if its type has no such
    field, the request ends with a service error.

    Args:
        hw: the simulated robot.
        node: node of the robot's namespace.
    """

    def __init__(self, hw: SimulatedRobot, node: Node) -> None:
        node = self._node = node.child("sim")
        self._hw, self._loop, self._plant = hw, hw.loop, hw.plant
        self._robot = read(hw.description).name
        self._limits: list[JointLimits] = load_limits(hw.description, None, hw.states.names, ("position",))
        self._waiting: list[tuple[float, str, Callable[[], None]]] = []
        SimTopics(hw, node, self._robot)
        self._loop.after_cycle.append(self._start_waiting)
        silent: dict[str, tuple[Any, Callable[[Any], None]]] = {
            "reset_simulation": (Empty, self._reset),
            "reset_world": (Empty, self._reset),
            "pause_physics": (Empty, lambda _: self._loop.pause()),
            "unpause_physics": (Empty, lambda _: self._loop.unpause()),
            "clear_body_wrenches": (BodyRequest, self._clear_wrenches),
        }
        responding: dict[str, tuple[Any, Callable[[Any, Any], str]]] = {
            "step": (StepSimulation, self._step),
            "set_real_time_factor": (SetRealTimeFactor, self._in_loop(self._set_factor)),
            "set_model_configuration": (SetModelConfiguration, self._in_loop(self._configure)),
            "apply_body_wrench": (ApplyBodyWrench, self._in_loop(self._wrench)),
            "spawn_urdf_model": (SpawnModel, self._in_loop(self._spawn)),
            "delete_model": (DeleteModel, self._in_loop(self._delete)),
            "get_link_state": (GetLinkState, self._in_loop(self._link_state)),
        }
        self._services = [node.service(name, kind, _silent(kind, act)) for name, (kind, act) in silent.items()]
        self._services += [node.service(name, kind, _responding(kind, act)) for name, (kind, act) in responding.items()]

    def _in_loop(self, action: Callable[[Any, Any], str]) -> Callable[[Any, Any], str]:
        return lambda request, response: self._loop.request(lambda: action(request, response))

    def _reset(self, _: Any) -> None:
        def reset() -> None:
            self._waiting.clear()
            self._hw.reset()

        self._loop.request(reset)

    def _step(self, request: Any, response: Any) -> str:
        try:
            response.time = self._loop.step(request.steps)
        except HricError:
            response.time = self._loop.time
            raise
        return f"{request.steps} cycles done"

    def _set_factor(self, request: Any, _: Any) -> str:
        factor = LIVE_FACTOR.checked(request.real_time_factor, LIVE_FACTOR.name)
        if not self._loop.real_time_factor:
            raise CommandError(
                "this run is not paced, and stays as fast as possible; valid: a start with real_time_factor above 0"
            )
        self._loop.real_time_factor = factor
        return f"{factor:g} s of robot time per second"

    def _configure(self, request: Any, _: Any) -> str:
        check_known("model with joints", [request.model_name or self._robot], [self._robot])
        names, positions = list(request.joint_names), [float(value) for value in request.joint_positions]
        if not names or len(names) != len(positions) or len(set(names)) != len(names):
            raise CommandError(
                f"{len(names)} joint_names (all different, at least one) need as many joint_positions; got "
                f"{len(positions)}"
            )
        known = self._hw.states.names
        check_known("joint", names, known, self._robot)
        messages.finite("joint_positions", *positions)
        # Joints that are not named keep their position.
        q = dict(zip(known, self._hw.states.position, strict=True)) | dict(zip(names, positions, strict=True))
        outside = [self._outside(limit, q[limit.name]) for limit in self._limits if limit.name in names]
        self._hw.set_configuration([q[name] for name in known])
        warning = "; ".join(text for text in outside if text)
        if warning:
            self._node.log_warn(f"set_model_configuration: {warning}")
        return f"{len(names)} joints set" + (f"; warning: {warning}" if warning else "")

    @staticmethod
    def _outside(limit: JointLimits, q: float) -> str:
        inside = limit.lower <= q <= limit.upper
        return (
            ""
            if inside
            else f"{limit.name} at {q:g} {limit.unit} is outside its range [{limit.lower:g}, {limit.upper:g}]"
        )

    def _frame(self, name: str) -> FloatArray:
        """Return T_world_frame, the pose of a frame in the world, shape (4, 4); `name`: a link or the world itself."""
        return np.eye(4) if name in WORLD else self._plant.link_state(name)[0]

    def _wrench(self, request: Any, _: Any) -> str:
        body, w, point = request.body_name, request.wrench, request.reference_point
        R = self._frame(request.reference_frame)[:3, :3]
        force = (R @ messages.finite("force", w.force.x, w.force.y, w.force.z)).tolist()
        torque = (R @ messages.finite("torque", w.torque.x, w.torque.y, w.torque.z)).tolist()
        at = messages.finite("reference_point", point.x, point.y, point.z)
        duration, start = request.duration.to_sec(), request.start_time.to_sec()
        self._plant.link_state(body)  # refuses an unknown body now, not at the start time
        if duration == 0.0:
            return "duration is 0: no wrench is applied (a negative duration applies it until it is cleared)"
        span = f"for {duration:g} s" if duration > 0.0 else "until cleared"

        def apply() -> None:
            self._plant.apply_wrench(body, force, torque, at, duration if duration > 0.0 else -1.0)

        if start > self._loop.time:
            self._waiting.append((start, body, apply))
            return f"wrench on {body} from {start:g} s {span}"
        apply()
        return f"wrench on {body} {span}"

    def _start_waiting(self, time: float) -> None:
        """Apply the wrenches whose start time is reached; called after a cycle, they act from the next step on."""
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

    def _clear_wrenches(self, request: Any) -> None:
        def clear() -> None:
            self._waiting = [entry for entry in self._waiting if request.body_name not in ("", entry[1])]
            self._plant.clear_wrenches(request.body_name or None)

        self._loop.request(clear)

    def _spawn(self, request: Any, _: Any) -> str:
        if not request.model_name or "::" in request.model_name:
            raise CommandError(f"model_name must be a name without '::'; got {request.model_name!r}")
        if request.model_name == self._robot:
            raise CommandError(f"model_name {request.model_name!r} is the robot's own")
        base = read(request.model_xml).root
        T = self._frame(request.reference_frame) @ messages.matrix(request.initial_pose)
        # A model whose root link is the world does not move, as in Gazebo.
        self._plant.spawn(request.model_name, request.model_xml, T, fixed=base == "world")
        return f"{request.model_name} spawned" + (", fixed" if base == "world" else "")

    def _delete(self, request: Any, _: Any) -> str:
        self._plant.delete(request.model_name)
        return f"{request.model_name} deleted"

    def _link_state(self, request: Any, response: Any) -> str:
        T, twist = self._plant.link_state(request.link_name)
        T_world_ref = self._frame(request.reference_frame)
        R, state = T_world_ref[:3, :3], response.link_state
        state.pose = stamped.pose_message(pose_of_transform(inverse(T_world_ref) @ T))
        state.twist = stamped.twist_message([*(R.T @ twist[:3]).tolist(), *(R.T @ twist[3:]).tolist()])
        state.link_name, state.reference_frame = request.link_name, request.reference_frame or "world"
        return f"state of {request.link_name} at {self._loop.time:.3f} s"


def sim_services(hw: RobotHW, node: Node) -> SimServices | None:
    """Offer the services of a simulated robot below `<node>/sim`; None: the robot is not simulated."""
    return SimServices(hw, node) if isinstance(hw, SimulatedRobot) else None


def _silent(kind: Any, action: Callable[[Any], None]) -> Callable[[Any], Any]:
    """Return the handler of a service whose response has no fields."""

    def handler(request: Any) -> Any:
        action(request)
        return kind._response_class()

    return handler


def _responding(kind: Any, action: Callable[[Any, Any], str]) -> Callable[[Any], Any]:
    """Return the handler of a service with `success` and `status_message` in its response.

    `action` returns the text of `status_message`, or raises HricError with the reason of a refusal."""

    def handler(request: Any) -> Any:
        response = kind._response_class()
        try:
            response.status_message = action(request, response)
            response.success = True
        except HricError as error:
            response.success, response.status_message = False, str(error)
        return response

    return handler
