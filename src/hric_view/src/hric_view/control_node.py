"""Commands of a window on a running system: services, topics and actions; and what can be commanded at present."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

import numpy as np
import rosgraph
import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Point, Vector3, Wrench
from scipy.spatial.transform import Rotation
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Empty, SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from franka_gripper.msg import MoveActionGoal, MoveGoal
from franka_msgs.msg import ErrorRecoveryActionGoal, FrankaState
from gazebo_msgs.srv import ApplyBodyWrench
from hric_control.manager.client import ManagerClient
from hric_core.errors import FailureError, HricError
from hric_core.geometry import FloatArray, pose_of_transform, stamped
from hric_core.ros import RosNode
from hric_core.urdf import Robot, read
from hric_dynamics.tree import Tree
from hric_msgs.srv import SetRealTimeFactor, StepSimulation
from hric_view.control import PERIOD, Controls
from hric_view.feeds import Feeds
from hric_view.live import LiveJoints

PATIENCE = 2.0
"""Longest wait for a service [s]; project default."""
PUSH = 0.3
"""Time for which a push lasts after the last message [s]; a slow page renews it three times a second."""
SPEED = 0.5
"""Joint speed of trajectories that the window sends [rad/s]; project default."""
DAMPING = 0.05
"""Damping of the inverse of the Jacobian [m or rad per rad], which keeps steps short near singular poses."""
BEHIND = (0.2, 0.8)
"""Largest difference of measured and commanded pose of the end effector [m], [rad]; project default.

It covers the sag of a soft controller, and bounds the force with which the arm presses against an obstacle."""
GRIP_SPEED = 0.1
"""Speed of the fingers [m/s]."""
PD, CARTESIAN = "hric_controllers/JointPDController", "hric_controllers/CartesianImpedanceController"
TRAJECTORIES = "JointTrajectoryController"
MODES = {
    getattr(FrankaState, name): name.removeprefix("ROBOT_MODE_").replace("_", " ").lower()
    for name in dir(FrankaState)
    if name.startswith("ROBOT_MODE_")
}
"""Names of the modes of the arm."""


class SystemActions:
    """Commands to the running system, each with a limited wait; see control.Actions.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        robot: description of the robot.
        joints: present positions of its joints.
        moved: joints that can be moved, in the order of the arm.
    """

    def __init__(self, root: RosNode, feeds: Feeds, robot: Robot, joints: LiveJoints, moved: Sequence[str]) -> None:
        self._root, self._joints, self._moved = root, joints, moved
        self._tree = Tree(robot, moved)
        self._tip = max(self._tree.index, key=lambda link: self._tree.index[link])
        self._manager = ManagerClient(root.namespace)
        self._lock = threading.Lock()
        self._controllers: list[Any] = []
        self._names: frozenset[str] = frozenset()
        """Published topics and services."""
        self._state: Any = None
        self._seen, self._stood, self._pushed = 0.0, False, 0.0
        self._simulated = root.has_param("/use_sim_time") and bool(root.param("/use_sim_time"))
        self._gripper = root.advertise("franka_gripper/move/goal", MoveActionGoal)
        self._recovery = root.advertise("franka_control/error_recovery/goal", ErrorRecoveryActionGoal)
        self._publishers: dict[str, Any] = {}
        self._commanded: tuple[str, Any] = ("", None)
        """Controller of the last motion, and what the window commanded: positions by joint, or T_base_ee.

        An arm that sags keeps its setpoint."""
        feeds.keep("franka_state_controller/franka_states", FrankaState, self._note)

    def watch(self, stop: threading.Event, needed: Callable[[], bool]) -> None:
        """Read regularly what can be commanded, while somebody needs to know it, until the event is set."""
        while not stop.wait(PERIOD):
            if needed():
                self._look()

    def _look(self) -> None:
        now = rospy.get_time()
        stood, self._seen = now == self._seen, now
        try:
            controllers = list(self._wait(self._manager.list))
            published, _, services = self._wait(rosgraph.Master(rospy.get_name()).getSystemState)
            names = frozenset(name for name, _ in [*published, *services])
        except (HricError, rosgraph.MasterException, OSError):
            controllers, names = [], frozenset()  # nothing can be commanded; the page shows that
        with self._lock:
            self._controllers, self._names, self._stood = controllers, names, stood

    def summary(self) -> dict[str, object]:
        """Return what can be commanded at present, for the page."""
        with self._lock:
            state, controllers, names = self._state, self._controllers, self._names
            return {
                "simulated": self._simulated,
                "stands": self._stood,
                "gripper": self._root.resolve("franka_gripper/move/result") in names,
                "recovery": self._root.resolve("franka_control/error_recovery/result") in names,
                "emulated": self._root.resolve("franka_control/set_user_stop") in names,
                "mode": "not known" if state is None else MODES.get(state.robot_mode, "not known"),
                "controllers": [
                    {"name": one.name, "state": one.state, "moves": bool(_resources(one))} for one in controllers
                ],
            }

    def begin(self) -> None:
        """Forget what was commanded: another program may have moved the arm since; see control.Actions."""
        self._commanded = "", None

    def pause(self) -> None:
        """See control.Actions."""
        self._call("sim/pause_physics", Empty)

    def proceed(self) -> None:
        """See control.Actions."""
        self._call("sim/unpause_physics", Empty)

    def step(self, cycles: int) -> None:
        """See control.Actions."""
        _demand(self._call("sim/step", StepSimulation, cycles))

    def set_pace(self, factor: float) -> None:
        """See control.Actions."""
        _demand(self._call("sim/set_real_time_factor", SetRealTimeFactor, factor))

    def reset(self) -> None:
        """See control.Actions."""
        self._call("sim/reset_simulation", Empty)
        self._commanded = "", None

    def switch(self, start: str, stop: Sequence[str]) -> None:
        """See control.Actions."""
        self._wait(lambda: self._manager.switch([start] if start else [], stop))
        self._commanded = "", None

    def move_joints(self, positions: Mapping[str, float]) -> None:
        """See control.Actions."""
        one = self._mover()
        names = list(self._root.param(f"{one.name}/joints"))
        if unknown := sorted(set(positions) - set(names)):
            raise HricError(f"{one.name} does not move {', '.join(unknown)}; it moves {', '.join(names)}")
        present = self._setpoint(one.name)
        target = [positions.get(name, present.get(name, 0.0)) for name in names]
        if one.type == PD:
            if self._root.param(f"{one.name}/profile/enabled", True) is not True:
                raise HricError(
                    f"{one.name} has no velocity profile, so the arm would jump; valid: profile/enabled: true"
                )
            message: Any = Float64MultiArray(data=target)
        elif TRAJECTORIES in one.type:
            now = self._present()
            far = max(abs(value - now.get(name, value)) for name, value in zip(names, target, strict=True))
            point = JointTrajectoryPoint(positions=target, time_from_start=rospy.Duration(max(far / SPEED, 0.5)))
            message = JointTrajectory(joint_names=names, points=[point])
        else:
            raise HricError(f"{one.name} takes no joint positions; start joint_pd_controller, or move the end effector")
        self._publish(f"{one.name}/command", message)
        self._commanded = one.name, dict(zip(names, target, strict=True))

    def jog(self, displacement: Sequence[float]) -> None:
        """See control.Actions."""
        with self._lock:
            state = self._state
        if state is None:
            raise HricError("the pose of the end effector is not known: no FrankaState has been received")
        one, T_base_ee = self._mover(), np.reshape(state.O_T_EE, (4, 4)).T
        if one.type == CARTESIAN:
            return self._lead(one.name, T_base_ee, displacement)
        present = self._setpoint(one.name)
        q = [present.get(name, 0.0) for name in self._tree.joints]
        J = self._tree.jacobian(q, self._tip, T_base_ee[:3, 3].tolist())
        dq = J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(6), np.asarray(displacement))
        self.move_joints({name: float(value + d) for name, value, d in zip(self._tree.joints, q, dq, strict=True)})

    def _lead(self, controller: str, T_base_ee: FloatArray, displacement: Sequence[float]) -> None:
        """Move the commanded pose of a Cartesian controller; the first one begins at the measured pose."""
        target = _moved(self._commanded[1] if self._commanded[0] == controller else T_base_ee, displacement)
        R = target[:3, :3] @ T_base_ee[:3, :3].T
        behind = np.linalg.norm(target[:3, 3] - T_base_ee[:3, 3]), Rotation.from_matrix(R).magnitude()
        if behind[0] > BEHIND[0] or behind[1] > BEHIND[1]:
            self._commanded = "", None
            raise HricError(
                f"the end effector does not follow: it would be {behind[0]:.2f} m and {behind[1]:.2f} rad from its "
                f"commanded pose; valid: up to {BEHIND[0]} m and {BEHIND[1]} rad. The next step begins where it is"
            )
        pose = stamped.pose_stamped(stamped.header(rospy.Time.now(), ""), pose_of_transform(target))
        self._publish(f"{controller}/equilibrium_pose", pose)
        self._commanded = controller, target

    def push(self, link: str, point: Sequence[float], force: Sequence[float]) -> None:
        """Push for PUSH from now on, without adding to what is left of earlier pushes; see control.Actions."""
        now, wrench = rospy.get_time(), Wrench(force=Vector3(*force))
        start = self._pushed if now < self._pushed <= now + PUSH else now
        if start == now + PUSH:
            return  # the simulation is paused
        when, duration = rospy.Time.from_sec(start), rospy.Duration.from_sec(now + PUSH - start)
        _demand(self._call("sim/apply_body_wrench", ApplyBodyWrench, link, "", Point(*point), wrench, when, duration))
        self._pushed = now + PUSH

    def grip(self, width: float) -> None:
        """See control.Actions."""
        goal = MoveActionGoal(Header(stamp=rospy.Time.now()), _goal_id(), MoveGoal(width=width, speed=GRIP_SPEED))
        self._send(self._gripper, goal, "franka_gripper/move")

    def recover(self) -> None:
        """See control.Actions."""
        goal = ErrorRecoveryActionGoal(header=Header(stamp=rospy.Time.now()), goal_id=_goal_id())
        self._send(self._recovery, goal, "franka_control/error_recovery")

    def press(self, button: str, pressed: bool) -> None:
        """See control.Actions."""
        response = self._call(f"franka_control/set_{button}", SetBool, pressed)
        if not response.success:
            raise HricError(f"{button.replace('_', ' ')}: {response.message}")

    def _note(self, data: bytes) -> None:
        message = FrankaState().deserialize(data)
        with self._lock:
            self._state = message
        if message.robot_mode != FrankaState.ROBOT_MODE_MOVE:
            self._commanded = "", None  # after a reflex or a user stop the arm may be elsewhere

    def _setpoint(self, controller: str) -> dict[str, float]:
        """Return what the window has commanded the controller; before that, the present positions."""
        return self._commanded[1] if self._commanded[0] == controller else self._present()

    def _present(self) -> dict[str, float]:
        known = dict(zip(self._joints.names, self._joints.state()["q"], strict=True))
        if missing := [name for name in self._moved if known[name] is None]:
            raise HricError(f"the position of {', '.join(missing)} is not known: no joint states have been received")
        return {name: value for name, value in known.items() if value is not None}

    def _mover(self) -> Any:
        """Return the running controller that moves the arm."""
        with self._lock:
            running = [one for one in self._controllers if one.state == "running" and _resources(one)]
        if not running:
            raise HricError("no controller that moves the arm is running; start one first")
        return running[0]

    def _publish(self, topic: str, message: Any) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._root.advertise(topic, type(message))
        self._send(self._publishers[topic], message, topic)

    def _send(self, publisher: Any, message: Any, name: str) -> None:
        """Publish a message once somebody subscribes."""
        deadline = time.monotonic() + PATIENCE
        while not publisher.subscribers():
            if time.monotonic() > deadline:
                raise FailureError(f"nobody takes {self._root.resolve(name)}: is its node or controller running?")
            time.sleep(0.02)
        publisher.publish(message)

    def _call(self, name: str, service: Any, *values: Any) -> Any:
        full = self._root.resolve(name)

        def call() -> Any:
            try:
                rospy.wait_for_service(full, 0.5 * PATIENCE)
                return rospy.ServiceProxy(full, service)(*values)
            except (rospy.ROSException, rospy.ServiceException) as error:
                raise FailureError(f"{full}: {error}") from error

        return self._wait(call)

    def _wait(self, call: Callable[[], Any]) -> Any:
        """Return the result of a call in a daemon thread, which neither blocks other calls nor the end of the node."""
        result: Future[Any] = Future()

        def work() -> None:
            try:
                result.set_result(call())
            except Exception as error:
                result.set_exception(error)

        threading.Thread(target=work, name="command", daemon=True).start()
        try:
            return result.result(PATIENCE)
        except TimeoutError:
            raise FailureError(f"the robot's node has not responded within {PATIENCE:g} s") from None


def controls_of(root: RosNode, feeds: Feeds, description: str, joints: LiveJoints) -> tuple[Controls, SystemActions]:
    """Return the receiver of commands for an arm, and what executes them.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        description: URDF of the arm.
        joints: present positions of its joints.
    """
    robot = read(description)
    moved = {
        name: (joint.limit.lower, joint.limit.upper)
        for name, joint in robot.joints.items()
        if joint.type == "revolute" and joint.limit is not None
    }
    actions = SystemActions(root, feeds, robot, joints, list(moved))
    return Controls(actions, moved, list(robot.links)), actions


def _demand(response: Any) -> None:
    if not response.success:
        raise HricError(response.status_message)


def _resources(controller: Any) -> list[str]:
    """Return what a controller claims: joints, or the arm."""
    return [name for claimed in controller.claimed_resources for name in claimed.resources]


def _moved(T_base_ee: FloatArray, displacement: Sequence[float]) -> FloatArray:
    """Return a pose after a displacement: translation [m], rotation vector [rad], both in the axes of the base."""
    T = T_base_ee.copy()
    T[:3, 3] += np.asarray(displacement[:3])
    T[:3, :3] = Rotation.from_rotvec(displacement[3:]).as_matrix() @ T_base_ee[:3, :3]
    return T


def _goal_id() -> GoalID:
    return GoalID(stamp=rospy.Time.now(), id=f"hric_view_{time.time_ns()}")
