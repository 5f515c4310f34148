"""Joint trajectory controllers with the topics, action, service and YAML of ros_controllers."""

import threading
from dataclasses import replace
from typing import Any, ClassVar

from trajectory_msgs.msg import JointTrajectory

from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryFeedback, JointTrajectoryControllerState
from control_msgs.srv import QueryTrajectoryState, QueryTrajectoryStateResponse
from hric_control.controller import Controller, SettingsClasses
from hric_control.hardware_interface import EffortJointInterface, JointCommandInterface, PositionJointInterface
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import ScaledTime, SpeedScaleInterface
from hric_controllers.dynamics import added_gravity, kd_check
from hric_controllers.state.messages import Point, build_state
from hric_controllers.trajectory import message as trajectories
from hric_controllers.trajectory.follower import Follower, GoalOutcome, GoalTolerances, Order
from hric_controllers.trajectory.goal import RunningGoal, result
from hric_controllers.trajectory.message import INVALID_GOAL, TrajectoryError
from hric_controllers.trajectory.settings import EffortTrajectorySettings, TrajectorySettings, continuous_joints
from hric_core import realtime
from hric_core.errors import HricError
from hric_core.node import GoalHandle, Node


class JointTrajectoryController(Controller):
    """Common part of the effort and position controllers.

    Callbacks of ROS convert trajectories to orders; the control loop follows these with a `Follower`.
    """

    interface: ClassVar[type[JointCommandInterface]]
    settings: SettingsClasses = (TrajectorySettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise topics, service and action.

        An error in a parameter or interface thus leaves nothing advertised.
        """
        node, self._robot = controller_node, robot_hw
        self._node = node
        settings = TrajectorySettings.read(node)
        self.joints = list(settings.joints)
        self._group = robot_hw.get(self.interface).group(self.joints)
        self._along = ScaledTime(robot_hw.get(SpeedScaleInterface).handle())
        self._tolerances = settings.tolerances(node.resolve("constraints"))
        self._partial = settings.allow_partial_joints_goal
        self._follower = Follower(
            self.joints, settings.stop_trajectory_duration, continuous_joints(root_node, self.joints)
        )
        self._read_law(robot_hw, root_node)
        self._state_time = realtime.Throttle(settings.state_publish_rate)
        self._feedback_time = realtime.Throttle(settings.action_monitor_rate)
        self._orders: realtime.LatestValue[Order | None] = realtime.LatestValue(None)
        self._lock = threading.RLock()  # between callbacks, which may nest on a LocalNode; the loop never takes it
        self._goal: RunningGoal | None = None
        self._running = False
        self._time = 0.0
        self._open()

    def _open(self) -> None:
        node = self._node
        self._state = realtime.publisher(node, "state", JointTrajectoryControllerState)
        node.subscribe("command", JointTrajectory, self._on_command, queue_size=1)
        node.service("query_state", QueryTrajectoryState, self._on_query)
        node.action_server("follow_joint_trajectory", FollowJointTrajectoryAction, self._on_goal, self._on_cancel)

    def _read_law(self, robot_hw: RobotHW, root_node: Node) -> None:
        """Read the parameters of the control law; a law without any does not override this."""

    def _start_law(self, q: list[float]) -> None:
        """Reset the control law at the controller's start; q: measured positions, n floats [rad]."""

    def _command(self, q: list[float], period: float) -> list[float]:
        """Return the commands of this cycle, n floats, from the follower's desired state and errors.

        Args:
            q: measured positions, n floats [rad].
            period: time since the last cycle [s].
        """
        raise NotImplementedError

    # Callbacks of ROS, in other threads than the loop.

    def _order(self, trajectory: Any, goal: RunningGoal | None, message: Any = None) -> Order:
        """Return the order for a trajectory; one without points is an order to stop.

        Args:
            trajectory: trajectory_msgs/JointTrajectory.
            goal: goal to which the trajectory belongs; None: it came on the topic `command`.
            message: FollowJointTrajectoryGoal with the tolerances; None: no tolerances are checked.

        Raises:
            TrajectoryError: the controller is not running, or the trajectory cannot be followed.
        """
        if not self._running:
            raise TrajectoryError(INVALID_GOAL, f"{self._node.namespace} is not running; start it first")
        if not trajectory.points:
            return Order(None)
        waypoints = trajectories.read_waypoints(trajectory, self.joints, self._partial)
        start = self._start(trajectory)
        self._check_future(start, trajectory.points[-1].time_from_start.to_sec())
        return Order(waypoints, start, goal, self._goal_tolerances(message, waypoints) if message is not None else None)

    def _start(self, trajectory: Any) -> float | None:
        """Return the robot time of the start [s], None (as soon as possible) for a stamp of zero."""
        stamp = trajectory.header.stamp
        return None if stamp.is_zero() else self._time + (stamp - self._node.now()).to_sec()

    def _check_future(self, start: float | None, duration: float) -> None:
        end = duration if start is None else start + duration - self._time
        if end <= 0.0:
            code = INVALID_GOAL if start is None else trajectories.OLD_HEADER_TIMESTAMP
            raise TrajectoryError(
                code,
                f"the last point lies {-end:.6g} s in the past; valid: in the future (a stamp of 0 means a start now)",
            )

    def _goal_tolerances(self, message: Any, waypoints: trajectories.Waypoints) -> GoalTolerances:
        try:
            tolerances = self._tolerances.overridden(
                self.joints, message.path_tolerance, message.goal_tolerance, message.goal_time_tolerance.to_sec()
            )
        except HricError as error:
            raise TrajectoryError(INVALID_GOAL, str(error)) from None
        return tolerances.only([points is not None for points in waypoints])

    def _on_goal(self, handle: GoalHandle) -> None:
        goal = RunningGoal(handle)
        with self._lock:
            try:
                order = self._order(handle.goal.trajectory, goal, handle.goal)
            except TrajectoryError as error:
                self._node.log_error(f"goal refused: {error}")
                handle.reject(result(error.code, str(error)), str(error))
                return
            handle.accept()
            self._replace(goal, "replaced by a new goal")
            self._orders.set(order)
            if order.waypoints is None:
                goal.finish(trajectories.SUCCESSFUL, "empty trajectory: the joints come to rest")
                self._goal = None
            if not self._running:  # the controller stopped while this goal was read
                self._replace(None, "the controller was stopped")

    def _on_cancel(self, handle: GoalHandle) -> None:
        with self._lock:
            goal = self._goal
            if goal is not None and goal.goal_id == handle.goal_id:
                self._orders.set(Order(None))
                self._replace(None, "cancelled by the client")

    def _on_command(self, message: Any) -> None:
        with self._lock:
            try:
                order = self._order(message, None)
            except TrajectoryError as error:
                raise TrajectoryError(error.code, f"trajectory refused, the present motion goes on: {error}") from None
            self._orders.set(order)
            self._replace(None, "replaced by a trajectory on the command topic")

    def _replace(self, goal: RunningGoal | None, text: str) -> None:
        before, self._goal = self._goal, goal
        if before is not None:
            before.cancel(text)

    def _on_query(self, request: Any) -> QueryTrajectoryStateResponse:
        if not self._running:
            raise HricError(f"{self._node.namespace} is not running; start it first")
        time = self._time if request.time.is_zero() else self._time + (request.time - self._node.now()).to_sec()
        position, velocity, acceleration = self._follower.look(time - self._along.lag)
        return QueryTrajectoryStateResponse(self.joints, position, velocity, acceleration)

    # Called in the loop.

    def starting(self, time: float) -> None:
        """Hold the present joint positions."""
        q = self._group.positions()
        self._orders.take_new()
        self._along.restart(time)
        self._follower.rest(time, q)
        self._start_law(q)
        self._state_time.restart()
        self._feedback_time.restart()
        self._give_up("the controller was restarted")
        self._time, self._running = time, True

    def update(self, time: float, period: float) -> None:
        """Follow the trajectory for one cycle: sample it, check tolerances, command the joints, publish."""
        self._time = time
        along, scale = self._along.along(time, period), self._along.scale.value
        order = self._orders.take_new()
        if order is not None and not (isinstance(order.goal, RunningGoal) and order.goal.ended):
            lag = self._along.lag
            # A start is given in robot time, which is ahead of the motion's time by the lag.
            self._follower.order(replace(order, start=order.start - lag) if lag and order.start is not None else order)
        group, follower = self._group, self._follower
        q, dq = group.positions(), group.velocities()
        outcome = follower.update(along, q, dq, scale)
        if self._robot.error:  # has priority over a tolerance violation, which would be its consequence
            outcome = follower.fail(along, f"the robot stopped: {self._robot.error}") or outcome
        group.set_command(self._command(q, period))
        if outcome is not None:
            self._report(outcome)
        if self._state_time.due(time):
            self._publish(q, dq)
        if self._goal is not None and self._feedback_time.due(time):
            self._send_feedback(self._goal, q, dq)

    def _report(self, outcome: GoalOutcome) -> None:
        goal = outcome.goal
        if isinstance(goal, RunningGoal):
            realtime.defer(self._node, lambda: self._finish(goal, outcome), "result of follow_joint_trajectory")

    def _finish(self, goal: RunningGoal, outcome: GoalOutcome) -> None:
        with self._lock:
            if self._goal is goal:
                self._goal = None
        if outcome.text:
            self._node.log_error(f"goal aborted: {outcome.text}")
        goal.finish(outcome.code, outcome.text)

    def _publish(self, q: list[float], dq: list[float]) -> None:
        stamp, f, efforts = self._node.now(), self._follower, self._group.efforts()
        desired: Point = (f.position, f.velocity, f.acceleration, [])
        self._state.publish(
            build_state, JointTrajectoryControllerState, stamp, self.joints, desired, (q, dq, [], efforts)
        )

    def _send_feedback(self, goal: RunningGoal, q: list[float], dq: list[float]) -> None:
        stamp, f = self._node.now(), self._follower
        desired: Point = (f.position, f.velocity, f.acceleration, [])
        realtime.defer(
            self._node,
            lambda: goal.feedback(
                build_state(FollowJointTrajectoryFeedback, stamp, self.joints, desired, (q, dq, [], []))
            ),
        )

    def stopping(self, time: float) -> None:
        """Cancel the running goal, if any."""
        self._running = False
        self._give_up("the controller was stopped")

    def _give_up(self, text: str) -> None:
        goal, self._goal = self._goal, None
        if goal is not None:
            realtime.defer(self._node, lambda: goal.cancel(text))


class EffortJointTrajectoryController(JointTrajectoryController):
    """Trajectory controller that commands efforts.

    effort = PID(desired - measured position) + velocity_ff * desired velocity, plus g(q) if `gravity` is true.
    """

    interface = EffortJointInterface
    settings = (TrajectorySettings, EffortTrajectorySettings)

    def _read_law(self, robot_hw: RobotHW, root_node: Node) -> None:
        node, settings = self._node, EffortTrajectorySettings.read(self._node, self.joints)
        if idle := settings.idle_integrals(self.joints):
            where = node.resolve("gains")
            node.log_warn(f"{where}: i without i_clamp has no effect ({', '.join(idle)}); give i_clamp [N m]")
        self._pids = settings.pids()
        self._gravity = added_gravity(robot_hw, root_node, node, self.joints) if settings.gravity else None
        self._forward = settings.velocity_ff
        check_kd = kd_check(robot_hw, root_node, node, self.joints, settings.rotor_inertia, settings.strict_gains)
        check_kd([item.d for item in settings.gains])

    def _start_law(self, q: list[float]) -> None:
        for pid in self._pids:
            pid.reset()

    def _command(self, q: list[float], period: float) -> list[float]:
        follower = self._follower
        rows = zip(self._pids, follower.position_error, follower.velocity_error, strict=True)
        effort = [pid.effort(error, period, rate) for pid, error, rate in rows]
        effort = [u + k * v for u, k, v in zip(effort, self._forward, follower.velocity, strict=True)]
        return effort if self._gravity is None else [u + g for u, g in zip(effort, self._gravity(q), strict=True)]


class PositionJointTrajectoryController(JointTrajectoryController):
    """Trajectory controller that commands the desired positions."""

    interface = PositionJointInterface

    def _command(self, q: list[float], period: float) -> list[float]:
        return self._follower.position
