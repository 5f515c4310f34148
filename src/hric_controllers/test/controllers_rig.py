"""A robot of independent unit-inertia joints with exact integration, and a headless loop around it: what the
controllers' tests run on."""

from hric_control.hardware_interface import (
    EffortJointInterface,
    JointCommands,
    JointStateInterface,
    JointStates,
    PositionJointInterface,
)
from hric_control.manager.controller_manager import ControllerManager
from hric_control.robot_hw import RobotHW
from hric_core.local.node import LocalNode

DT = 0.001


class Rig(RobotHW):
    """n joints of inertia 1 kg m^2: effort gives acceleration; a position command is reached within one step."""

    def __init__(self, joints, compensates_gravity=True, inertia=1.0):
        super().__init__()
        self.states = JointStates(joints)
        self.effort, self.goal = JointCommands(self.states), JointCommands(self.states)
        self.compensates_gravity, self.inertia = compensates_gravity, inertia
        self.blocked = False
        self.position_mode = set()
        self.register_interface(JointStateInterface(self.states))
        self.register_interface(EffortJointInterface(self.effort))
        self.register_interface(PositionJointInterface(self.goal))

    def do_switch(self, start, stop):
        for info in stop:
            self.position_mode -= info.claims.get(PositionJointInterface.cpp_name, frozenset())
        for info in start:
            self.position_mode |= info.claims.get(PositionJointInterface.cpp_name, frozenset())

    def advance(self):
        s = self.states
        for i, name in enumerate(s.names):
            if self.blocked:
                s.velocity[i] = 0.0
            elif name in self.position_mode:
                s.velocity[i] = (self.goal.value[i] - s.position[i]) / DT
                s.position[i] = self.goal.value[i]
            else:
                acceleration = self.effort.value[i] / self.inertia
                s.position[i] += DT * (s.velocity[i] + 0.5 * DT * acceleration)
                s.velocity[i] += DT * acceleration
                s.effort[i] = self.effort.value[i]


class Lab:
    """Rig + manager on a LocalNode: `run(seconds)` cycles; every message is kept in `messages[topic]`."""

    def __init__(self, params, joints=("a", "b"), **rig):
        self.node = LocalNode(params)
        self.hw = rig.pop("hw", None) or Rig(joints, **rig)
        self.time = 0.0
        self.cycle = 0
        self.node.clock = lambda: self.time
        self.messages = {}
        self.node.tap(lambda topic, message, time: self.messages.setdefault(topic, []).append((time, message)))
        self.manager = ControllerManager(self.hw, self.node)
        self.manager.loop_running = False
        self.history = []

    def load(self, name, start=True):
        self.manager.load(name)
        if start:
            self.manager.switch([name], [])
        return self

    def run(self, seconds, reset=False):
        for _ in range(round(seconds / DT)):
            self.manager.update(self.time, DT, reset)
            reset = False
            self.history.append(
                (self.time, list(self.hw.states.position), list(self.hw.effort.value), list(self.hw.goal.value))
            )
            self.hw.advance()
            self.cycle += 1
            self.time = self.cycle * DT
        return self

    def state(self, name):
        return next(entry.state for entry in self.manager.list() if entry.name == name)

    def published(self, topic):
        return [message for _, message in self.messages.get(topic, [])]

    def publisher(self, topic, kind):
        return self.node.advertise(topic, kind)

    def send(self, topic, message):
        self.node.advertise(topic, type(message)).publish(message)
