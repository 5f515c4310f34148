"""Simulated robot with two joints of 1 kg m^2 and no gravity, whose motion can be calculated by hand."""

from collections.abc import Sequence
from contextlib import ExitStack

import numpy as np

from hric_control.hardware_interface import EffortJointInterface, JointCommands, JointStateInterface, JointStates
from hric_control.limits import EffortLimiter, LimitCounts, load_limits
from hric_control.plant import Contact, FloatArray, JointReaction, Load, ReactingPlant
from hric_control.sim.participants import Participants
from hric_control.sim.sim_loop import SimLoop
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_core.errors import HricError, UnknownNameError
from hric_core.node import Node

URDF = """<robot name="toy">
  <link name="base"/><link name="one"/><link name="two"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="one"/><limit lower="-2" upper="2" velocity="3" effort="10"/></joint>
  <joint name="j2" type="revolute"><parent link="one"/><child link="two"/><limit lower="-1" upper="1" velocity="3" effort="10"/></joint>
  <gazebo><plugin name="gazebo_ros_control" filename="libgazebo_ros_control.so"><robotSimType>toy/Toy</robotSimType></plugin></gazebo>
</robot>"""  # noqa: E501

CUBE = """<robot name="cube"><link name="cube_link"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


class DoubleIntegrator(ReactingPlant):
    """Plant with q'' = tau for each joint, integrated semi-implicitly; records the calls of its methods."""

    def __init__(self, joint_names: Sequence[str], time_step: float) -> None:
        self.joint_names, self.time_step = tuple(joint_names), time_step
        self.q, self.dq, self.tau = np.zeros(2), np.zeros(2), np.zeros(2)
        self.wrenches: list[tuple] = []
        self.models: dict[str, tuple[FloatArray, bool]] = {}
        self.touching: list[Contact] = []
        self.peaks: list[dict[tuple[str, str], float]] = []
        self.steps = self.resets = 0
        self.closed = False

    def reset(self, q, dq=None) -> None:
        self.set_configuration(q)
        self.wrenches.clear()
        self.resets += 1

    def set_configuration(self, q) -> None:
        self.q[:], self.dq[:] = q, 0.0

    def read_state(self, q, dq, tau) -> None:
        q[:], dq[:], tau[:] = self.q.tolist(), self.dq.tolist(), self.tau.tolist()

    def motor_effort(self):
        return self.tau.tolist()

    def engine_state(self):
        return self.q.tolist(), self.dq.tolist()

    def apply(self, tau) -> None:
        self.tau[:] = tau

    def step(self) -> None:
        self.dq += self.time_step * self.tau
        self.q += self.time_step * self.dq
        self.steps += 1

    def set_brakes(self, on) -> None: ...

    def set_load(self, load: Load | None, link: str | None = None) -> None: ...

    def apply_wrench(self, body, force, torque, point, duration) -> None:
        self.wrenches.append((body, tuple(force), tuple(torque), tuple(point), duration, self.steps))

    def clear_wrenches(self, body=None) -> None:
        self.wrenches = [] if body is None else [wrench for wrench in self.wrenches if wrench[0] != body]

    def contacts(self) -> list[Contact]:
        return self.touching

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        return self.peaks.pop(0) if self.peaks else {}

    def joint_reactions(self) -> list[JointReaction]:
        return [JointReaction("j1", "one", (0.0, 0.0, 1.0), (0.0, 0.0, 9.0), (1.0, 2.0, 3.0))]

    def _spawn(self, name, urdf_xml, T_world_model, fixed, surfaces) -> None:
        if name in self.models:
            raise HricError(f"model {name} exists already")
        self.models[name] = (T_world_model, fixed)

    def delete(self, name) -> None:
        if name not in self.models:
            raise UnknownNameError("model", name, self.models)
        del self.models[name]

    def model_names(self) -> list[str]:
        return list(self.models)

    def link_state(self, body):
        model, _, link = body.rpartition("::")
        if model in self.models:
            return self.models[model][0], np.zeros(6)
        if link not in ("base", "one", "two"):
            raise UnknownNameError("link", body, ["base", "one", "two"])
        T = np.eye(4)
        if link != "base":  # turned by j1 about z, one metre out
            c, s = np.cos(self.q[0]), np.sin(self.q[0])
            T[:3, :3], T[:3, 3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]], [c, s, 0]
        return T, np.array([1.0, 0.0, 0.0, 0.0, 0.0, self.dq[0]])

    def mass_matrix(self):
        return np.eye(2)

    def close(self) -> None:
        self.closed = True


class ToyRobot(SimulatedRobot):
    """The double integrator as a robot; effort interface only."""

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        self.description = root_node.search_param("robot_description", URDF)
        self.states = JointStates(["j1", "j2"])
        self.commands = JointCommands(self.states)
        self.loop = SimLoop(0.001, robot_hw_node.param("real_time_factor", 1.0))
        self.plant = DoubleIntegrator(self.states.names, 0.001)
        self._held = ExitStack()
        self._held.callback(self.plant.close)
        self._participants = Participants(self.plant, robot_hw_node)
        self._held.callback(self._participants.close)
        self.limiter = EffortLimiter(
            self.states, self.commands, load_limits(self.description, root_node, self.states.names)
        )
        self.q_start = [0.0, 0.0]
        self._raw = [0.0, 0.0]
        self.register_interface(JointStateInterface(self.states))
        self.register_interface(EffortJointInterface(self.commands))

    def write(self, time: float, period: float) -> None:
        self._raw = self.commands.value[:]
        self.limiter.enforce(period)
        self.plant.apply(self.commands.value)

    def _settle(self, q) -> None:
        self.read(0.0, 0.0)
        self.commands.value[:] = [0.0, 0.0]
        self.limiter.reset([0.0, 0.0])

    def limiter_counts(self) -> LimitCounts:
        return self.limiter.counts

    def log_row(self):
        return ["effort", "effort"], self._raw, self.commands.value[:]
