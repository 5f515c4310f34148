"""Execution of the page's commands on a running ROS system, by its services, topics and actions."""

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
"""Longest wait for the response of a service, or for a subscriber [s of wall time]; project default."""
PUSH = 0.3
"""Robot time for which a force acts after a command `push` [s]; the page repeats the command at least 3 times a second.
"""
SPEED = 0.5
"""Mean speed of the fastest joint in the trajectories that the window sends [rad/s]; project default."""
DAMPING = 0.05
"""Damping of the inverse of the Jacobian [m or rad per rad], which keeps joint steps short near singular poses;
project default."""
BEHIND = (0.2, 0.8)
"""Largest difference of measured and commanded pose of the end effector [m], [rad]; project default.

It is large enough for the sag of a soft controller, and limits the force with which the arm presses on an obstacle."""
GRIP_SPEED = 0.1
"""Speed of the fingers of the Franka hand [m/s]; project default."""
PD, CARTESIAN = "hric_controllers/JointPDController", "hric_controllers/CartesianImpedanceController"
TRAJECTORIES = "JointTrajectoryController"
MODES = {
    getattr(FrankaState, name): name.removeprefix("ROBOT_MODE_").replace("_", " ").lower()
    for name in dir(FrankaState)
    if name.startswith("ROBOT_MODE_")
}
"""Names of the arm's modes by their number in franka_msgs/FrankaState."""


class SystemActions:
    """Executor of the commands of `control.Actions` on a running ROS system; each waits at most PATIENCE.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        robot: URDF of the robot.
        joints: newest joint positions of the robot.
        moved: names of the joints that can be moved, from the base to the tip.
    """

    def __init__(self, root: RosNode, feeds: Feeds, robot: Robot, joints: LiveJoints, moved: Sequence[str]) -> None:
        self._root, self._joints, self._moved = root, joints, moved
        self._tree = Tree(robot, moved)
        self._tip = max(self._tree.index, key=lambda link: self._tree.index[link])
        self._manager = ManagerClient(root.namespace)
        self._lock = threading.Lock()
        self._controllers: list[Any] = []
        self._names: frozenset[str] = frozenset()
        """Full names of all published topics and services."""
        self._state: Any = None
        self._seen, self._stood, self._pushed = 0.0, False, 0.0
        self._simulated = root.has_param("/use_sim_time") and bool(root.param("/use_sim_time"))
        self._gripper = root.advertise("franka_gripper/move/goal", MoveActionGoal)
        self._recovery = root.advertise("franka_control/error_recovery/goal", ErrorRecoveryActionGoal)
        self._publishers: dict[str, Any] = {}
        self._commanded: tuple[str, Any] = ("", None)
        """Name of the controller that the last motion command went to, and its setpoint.

        The setpoint is positions by joint [rad], or T_base_ee, shape (4, 4). The next command starts from it and not
        from the measured pose, so that a sagging arm does not sag further with each command."""
        feeds.keep("franka_state_controller/franka_states", FrankaState, self._note)

    def watch(self, stop: threading.Event, needed: Callable[[], bool]) -> None:
        """Read controllers, topics and services every PERIOD until the event `stop` is set.

        Args:
            stop: event that ends the call.
            needed: function that returns True if a viewer is connected; else nothing is read.
        """
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
        """Return the mode of the arm, the controllers, and the available commands, as last read by `watch`."""
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
        """Delete the last setpoint, since another program may have moved the arm: the next motion starts measured."""
        self._commanded = "", None

    def pause(self) -> None:
        """Call the service sim/pause_physics."""
        self._call("sim/pause_physics", Empty)

    def proceed(self) -> None:
        """Call the service sim/unpause_physics."""
        self._call("sim/unpause_physics", Empty)

    def step(self, cycles: int) -> None:
        """Call the service sim/step; cycles: number of control cycles."""
        _demand(self._call("sim/step", StepSimulation, cycles))

    def set_pace(self, factor: float) -> None:
        """Call the service sim/set_real_time_factor; factor: robot time per wall time [1], 0: as fast as possible."""
        _demand(self._call("sim/set_real_time_factor", SetRealTimeFactor, factor))

    def reset(self) -> None:
        """Call the service sim/reset_simulation."""
        self._call("sim/reset_simulation", Empty)
        self._commanded = "", None

    def switch(self, start: str, stop: Sequence[str]) -> None:
        """Start a controller ("": none) and stop others, by the service controller_manager/switch_controller."""
        self._wait(lambda: self._manager.switch([start] if start else [], stop))
        self._commanded = "", None

    def move_joints(self, positions: Mapping[str, float]) -> None:
        """Send joint positions by name [rad] to the running controller, on its topic `command`."""
        one = self._mover()
        names = list(self._root.param(f"{one.name}/joints"))
        if unknown := sorted(set(positions) - set(names)):
            raise HricError(f"{one.name} does not move {', '.join(unknown)}; it moves {', '.join(names)}")
        present = self._setpoint(one.name)
        target = [positions.get(name, present.get(name, 0.0)) for name in names]
        if one.type == PD:
            if self._root.param(f"{one.name}/profile/enabled", True) is not True:
                raise HricError(
                    f"{one.name} has no velocity profile, so the arm would jump; valid: parameter profile/enabled: true"
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
        """Move the end effector by the running controller: its pose if it is Cartesian, else joint positions.

        Args:
            displacement: 3 translations [m] and a rotation vector [rad], in the axes of the base.
        """
        with self._lock:
            state = self._state
        if state is None:
            raise HricError(
                "the pose of the end effector is not known: nothing was received on "
                "franka_state_controller/franka_states; is this controller running?"
            )
        one, T_base_ee = self._mover(), np.reshape(state.O_T_EE, (4, 4)).T
        if one.type == CARTESIAN:
            return self._lead(one.name, T_base_ee, displacement)
        present = self._setpoint(one.name)
        q = [present.get(name, 0.0) for name in self._tree.joints]
        J = self._tree.jacobian(q, self._tip, T_base_ee[:3, 3].tolist())
        dq = J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(6), np.asarray(displacement))
        self.move_joints({name: float(value + d) for name, value, d in zip(self._tree.joints, q, dq, strict=True)})

    def _lead(self, controller: str, T_base_ee: FloatArray, displacement: Sequence[float]) -> None:
        """Move the commanded pose of a Cartesian controller by a displacement; the first starts at the measured pose.

        Args:
            controller: name of the controller.
            T_base_ee: measured pose of the end effector, shape (4, 4).
            displacement: 3 translations [m] and a rotation vector [rad], in the axes of the base.

        Raises:
            HricError: the end effector is too far from the new commanded pose (BEHIND).
        """
        target = _moved(self._commanded[1] if self._commanded[0] == controller else T_base_ee, displacement)
        R = target[:3, :3] @ T_base_ee[:3, :3].T
        behind = np.linalg.norm(target[:3, 3] - T_base_ee[:3, 3]), Rotation.from_matrix(R).magnitude()
        if behind[0] > BEHIND[0] or behind[1] > BEHIND[1]:
            self._commanded = "", None
            raise HricError(
                f"the end effector does not follow: it would be {behind[0]:.2f} m and {behind[1]:.2f} rad from its "
                f"commanded pose; valid: up to {BEHIND[0]} m, {BEHIND[1]} rad. The next step starts at its present pose"
            )
        pose = stamped.pose_stamped(stamped.header(rospy.Time.now(), ""), pose_of_transform(target))
        self._publish(f"{controller}/equilibrium_pose", pose)
        self._commanded = controller, target

    def push(self, link: str, point: Sequence[float], force: Sequence[float]) -> None:
        """Apply a force from now on for PUSH seconds by the service sim/apply_body_wrench; it replaces earlier ones.

        Args:
            link: name of the link.
            point: point of application in the frame of the link, x, y, z [m].
            force: force in the axes of the world, x, y, z [N].
        """
        now, wrench = rospy.get_time(), Wrench(force=Vector3(*force))
        start = self._pushed if now < self._pushed <= now + PUSH else now
        if start == now + PUSH:
            return  # the simulation is paused
        when, duration = rospy.Time.from_sec(start), rospy.Duration.from_sec(now + PUSH - start)
        _demand(self._call("sim/apply_body_wrench", ApplyBodyWrench, link, "", Point(*point), wrench, when, duration))
        self._pushed = now + PUSH

    def grip(self, width: float) -> None:
        """Send a goal to the action franka_gripper/move; width: distance between the fingers [m]."""
        goal = MoveActionGoal(Header(stamp=rospy.Time.now()), _goal_id(), MoveGoal(width=width, speed=GRIP_SPEED))
        self._send(self._gripper, goal, "franka_gripper/move")

    def recover(self) -> None:
        """Send a goal to the action franka_control/error_recovery."""
        goal = ErrorRecoveryActionGoal(header=Header(stamp=rospy.Time.now()), goal_id=_goal_id())
        self._send(self._recovery, goal, "franka_control/error_recovery")

    def press(self, button: str, pressed: bool) -> None:
        """Call the service franka_control/set_user_stop or franka_control/set_guiding of an emulated arm.

        Args:
            button: one of control.BUTTONS.
            pressed: True: press; False: release.
        """
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
        """Return the last setpoint for a controller, by joint [rad]; without one, the measured positions."""
        return self._commanded[1] if self._commanded[0] == controller else self._present()

    def _present(self) -> dict[str, float]:
        known = dict(zip(self._joints.names, self._joints.state()["q"], strict=True))
        if missing := [name for name in self._moved if known[name] is None]:
            raise HricError(f"the position of {', '.join(missing)} is not known: nothing was received on joint_states")
        return {name: value for name, value in known.items() if value is not None}

    def _mover(self) -> Any:
        """Return the running controller that has claimed joints or the arm. Raises HricError if there is none."""
        with self._lock:
            running = [one for one in self._controllers if one.state == "running" and _resources(one)]
        if not running:
            raise HricError("no controller that moves the arm is running; start one first, e.g. joint_pd_controller")
        return running[0]

    def _publish(self, topic: str, message: Any) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._root.advertise(topic, type(message))
        self._send(self._publishers[topic], message, topic)

    def _send(self, publisher: Any, message: Any, name: str) -> None:
        """Publish a message as soon as the topic has a subscriber. Raises FailureError after PATIENCE without one."""
        deadline = time.monotonic() + PATIENCE
        while not publisher.subscribers():
            if time.monotonic() > deadline:
                raise FailureError(
                    f"nothing subscribes to {self._root.resolve(name)}: is its node or controller running?"
                )
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
        """Run a function in a daemon thread and return its result. Raises FailureError if it takes over PATIENCE.

        A call that hangs therefore blocks neither other calls nor the shutdown of the node.
        """
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
            raise FailureError(f"the robot has not responded within {PATIENCE:g} s; is the bring-up running?") from None


def controls_of(root: RosNode, feeds: Feeds, description: str, joints: LiveJoints) -> tuple[Controls, SystemActions]:
    """Return the receiver of the viewers' commands for an arm, and the object that executes them.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        description: URDF of the arm.
        joints: newest joint positions of the arm.
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
    """Return the names of the joints, or of the arm, that a controller claims."""
    return [name for claimed in controller.claimed_resources for name in claimed.resources]


def _moved(T_base_ee: FloatArray, displacement: Sequence[float]) -> FloatArray:
    """Return a pose after a displacement in the axes of the base: 3 translations [m], rotation vector [rad]."""
    T = T_base_ee.copy()
    T[:3, 3] += np.asarray(displacement[:3])
    T[:3, :3] = Rotation.from_rotvec(displacement[3:]).as_matrix() @ T_base_ee[:3, :3]
    return T


def _goal_id() -> GoalID:
    return GoalID(stamp=rospy.Time.now(), id=f"hric_view_{time.time_ns()}")
