"""Controller whose setpoints come from a trained policy."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped

from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.model import FrankaFrame
from hric_control.robot_hw import RobotHW
from hric_controllers.cartesian.workspace import Box
from hric_controllers.marker.parameters import Workspace
from hric_controllers.parameters import ArmSettings
from hric_controllers.policy.contract import PolicyRobot, Vector, moved, within
from hric_controllers.policy.network import PolicyNetwork
from hric_controllers.streaming.joint import JointStreamingSettings, StreamedJoints
from hric_core import realtime, resources
from hric_core.errors import CommandError, FailureError, ParameterError
from hric_core.geometry import FloatArray
from hric_core.node import Node
from hric_core.parameters import flag, numbers, refused, section, text, whole

CYCLE = 1e-3
"""Period of the control loop of the arm [s]."""
LARGEST_SHARE = 0.1
"""Largest share of a cycle that a run of the network may take within the loop [1] (project default)."""

LEAVING = 5.0
"""Distance from a reached goal at which the policy acts again, relative to that at which it is reached [1].

Project default."""
EXACT = 1e-4
"""Distance of the setpoint from a reached goal below which it stays [m] (project default)."""
REST = 1e-6
"""Velocity of a joint below which it is at rest [rad/s]."""


@dataclass(frozen=True)
class PolicySettings(ArmSettings):
    """Parameters of the policy controller."""

    file: str = text(empty=False, text="ONNX file of the policy, path or package://, as `hric train` writes it")
    goal: tuple[float, ...] | None = numbers(
        3,
        None,
        unit="m",
        text="goal of the end effector at the start, in `<arm_id>_link0`; none: the arm waits",
    )
    delay: int = whole(
        0,
        minimum=0,
        maximum=1000,
        unit="cycles",
        text="the network runs in a thread, and its result is used after this number of cycles, less than the period "
        "of the policy; 0: the network runs in the control loop",
    )
    workspace: Box = section(Workspace)
    other_ranges: bool = flag(
        False,
        text="run a policy of an arm with the same kinematics and other joint ranges, such as one of the Panda on an "
        "FR3; setpoints stay within the ranges of this arm",
    )

    def check(self, where: str) -> None:
        """Raise an error if the goal is outside the workspace."""
        if self.goal is not None and not self.workspace.contains(self.goal):
            raise refused(f"{where}goal", self.goal, f"a point in the workspace, {self.workspace}")


class PolicyController(StreamedJoints):
    """Controller that streams the setpoints of a policy to the joints, at limited velocity, acceleration and jerk.

    The policy acts until the end effector is near the goal, and again when it is not; this controller moves the rest of
    the way. If its output is not finite, or the network cannot be executed, the arm comes to rest at the last setpoint;
    then this controller stops with an error.
    """

    settings = (JointStreamingSettings, PolicySettings)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters and the policy, get the hardware interfaces, and then advertise the topics."""
        settings = self._policy_settings = PolicySettings.read(controller_node)
        network = self._network = PolicyNetwork(resources.resolve(settings.file))
        if network.cost > LARGEST_SHARE * CYCLE and settings.delay == 0:
            raise refused(
                controller_node.resolve("delay"),
                0,
                f"1 or more: a run of {settings.file} takes {1e3 * network.cost:.2f} ms, more than "
                f"{100.0 * LARGEST_SHARE:g} % of a cycle",
            )
        contract = network.contract
        if settings.delay * CYCLE >= contract.period:
            raise refused(controller_node.resolve("delay"), settings.delay, f"less than {contract.period / CYCLE:g}")
        self._arm = robot_hw.get(FrankaStateInterface).handle(f"{settings.arm_id}_robot").robot_state
        self._model = robot_hw.get(FrankaModelInterface).of(settings.arm_id).model
        super().init(robot_hw, root_node, controller_node)
        if len(self.joints) != 7:
            raise refused(controller_node.resolve("joints"), self.joints, "the 7 joints of the arm")
        self._goals = self._checked_goals()
        if settings.goal is not None and not self._goals.contains(settings.goal):
            raise refused(controller_node.resolve("goal"), settings.goal, f"a goal of the policy, {self._goals}")
        self._low, self._high = np.array(self._ranges).T
        self._goal: realtime.LatestValue[tuple[float, ...] | None] = realtime.LatestValue(None)
        self._decisions = realtime.Throttle(1.0 / contract.period)
        self._executor = ThreadPoolExecutor(1, "policy") if settings.delay else None
        controller_node.subscribe("goal", PointStamped, self._on_goal, queue_size=1)

    def _checked_goals(self) -> Box:
        """Return the box of the goals. Raises ParameterError if the policy was trained on another or an unknown robot."""
        settings = self._policy_settings
        arm = PolicyRobot.of_arm(settings.arm_id, self.joints, self._ranges, self._model)
        try:
            return self._network.contract.check_robot(arm, ("lower", "upper") if settings.other_ranges else ())
        except ParameterError as error:
            raise ParameterError(f"{settings.file}: {error}") from None

    def _on_goal(self, message: Any) -> None:
        """Check a goal and pass it to the loop. Raises CommandError if it is refused."""
        base, point = f"{self._policy_settings.arm_id}_link0", (message.point.x, message.point.y, message.point.z)
        if not self._running:
            raise CommandError("the controller is not running, the goal is ignored; start it first")
        box, goals = self._policy_settings.workspace, self._goals
        framed = message.header.frame_id.lstrip("/") in ("", base)
        if not (framed and box.contains(point) and goals.contains(point)):
            raise CommandError(
                f"goal {point} in frame {message.header.frame_id!r} refused; valid: finite numbers, in {base}, {goals} "
                f"(goals of the policy), and {box} (workspace)"
            )
        self._goal.set(point)

    def starting(self, time: float) -> None:
        """Hold the position until there is a goal. Raises ParameterError if the end effector was changed."""
        self._checked_goals()
        super().starting(time)
        self._goal.set(self._policy_settings.goal)
        self._decisions.restart()
        self._setpoint = within(np.array(self._group.positions()), self._low, self._high)
        self._running_network: Future[Vector] | None = None
        self._reached: tuple[float, ...] | None = None
        self._wait, self._failure = 0, ""

    def update(self, time: float, period: float) -> None:
        """Run the policy if it is time to do so, and advance the motion by one cycle.

        Raises:
            FailureError: the policy gave no finite output, and the arm has come to rest.
        """
        goal = self._goal.get()
        self._take_result()
        if goal is not None and not self._failure and self._decisions.due(time):
            self._decide(goal)
        super().update(time, period)
        if self._failure and self._follower.ceased and max(map(abs, self._follower.velocity)) < REST:
            raise FailureError(self._failure)

    def _decide(self, goal: tuple[float, ...]) -> None:
        """Pass the present observation to the network, unless the end effector is at the goal."""
        state, contract = self._arm, self._network.contract
        ee_position = state.O_T_EE[12:15]
        if math.dist(ee_position, goal) < contract.near * (LEAVING if self._reached == goal else 1.0):
            self._reached = goal
            self._arrive(goal)
            return
        self._reached = None
        values: dict[str, Sequence[float]] = {
            "q": state.q,
            "dq": state.dq,
            "command": self._setpoint.tolist(),
            "ee_position": ee_position,
            "wrench": state.O_F_ext_hat_K,
            "goal": goal,
        }
        observation = contract.observation(values)
        if self._executor is None:
            self._act(partial(self._network, observation))
        elif self._running_network is None:
            self._running_network = self._executor.submit(self._network, observation)
            self._wait = self._policy_settings.delay

    def _take_result(self) -> None:
        """Apply the action from the thread after `delay` cycles, or as soon as it is computed if that is later."""
        if self._running_network is None:
            return
        self._wait -= 1
        # Without real time the cycle of the result must not depend on the speed of the machine.
        if self._wait <= 0 and (self._running_network.done() or self._node.publishes_inline):
            result, self._running_network = self._running_network.result, None
            self._act(result)

    def _act(self, result: Callable[[], Vector]) -> None:
        """Move the setpoint by the velocity of an action, which `result` returns, for one period."""
        try:
            action = result()
        except FailureError as error:
            self._failure = f"{error}; the arm was stopped"
            return
        if not np.isfinite(action).all():
            self._failure = f"the output of the policy {self._policy_settings.file} is not finite; the arm was stopped"
            return
        contract = self._network.contract
        self._move(contract.action_scale * contract.period * np.clip(action.astype(float), -1.0, 1.0))

    def _arrive(self, goal: tuple[float, ...]) -> None:
        """Move the setpoint, which is ahead of the arm, to the goal; there the arm rests without the policy."""
        left = np.array(goal) - self._model.pose(FrankaFrame.END_EFFECTOR, self._setpoint.tolist())[:3, 3]
        if np.linalg.norm(left) > EXACT:
            self._move(left)

    def _move(self, displacement: FloatArray) -> None:
        """Move the setpoint by a displacement of the end effector within one period, not out of the workspace."""
        box, p = self._policy_settings.workspace, self._model.pose(FrankaFrame.END_EFFECTOR, self._setpoint.tolist())
        left = np.subtract(box.lower, p[:3, 3]), np.subtract(box.upper, p[:3, 3])
        displacement = np.clip(displacement, np.minimum(left[0], 0.0), np.maximum(left[1], 0.0))
        after = moved(self._model, self._setpoint, self._scale.value * displacement, self._network.contract.period)
        self._setpoint = within(after, self._low, self._high)
        self._targets.append((self._setpoint.tolist(), None))

    def shutdown(self) -> None:
        """Stop the thread of the network."""
        if self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
