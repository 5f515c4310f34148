"""The log of every cycle."""

from hric_control.control_log import BATCH, ControlLog
from hric_control.hardware_interface import JointStateInterface, JointStates
from hric_control.robot_hw import RobotHW
from hric_core.local.node import LocalNode
from hric_core.robot_time import stamps
from hric_msgs.msg import ControlLog as ControlLogMessage


class Recorder:
    """A control log of two joints, its messages, and a robot whose commands can be set."""

    def __init__(self):
        self.messages = []
        self.states = JointStates(["a", "b"])
        self.row = ["effort", "effort"], [0.0, 0.0], [0.0, 0.0]
        hw, node = RobotHW(), LocalNode()
        hw.register_interface(JointStateInterface(self.states))
        hw.log_row = lambda: self.row
        node.subscribe("control_log", ControlLogMessage, self.messages.append)
        self.log = ControlLog(hw, node, stamps.to_time)

    def cycle(self, k):
        self.log.complete()
        self.states.position[:] = [float(k), k + 0.5]
        self.states.velocity[:] = [10.0 * k, 0.0]
        self.log.begin(0.001 * k)
        self.row = self.row[0], [float(k), -1.0], [0.5 * k, -1.0]


def test_every_cycle_is_there_once_in_order_with_its_own_state_and_commands():
    recorder, n = Recorder(), 3 * BATCH + 7
    for k in range(n):
        recorder.cycle(k)
    recorder.log.complete()
    recorder.log.flush()
    assert [message.n_cycles for message in recorder.messages] == [BATCH, BATCH, BATCH, 7]
    assert [message.first_cycle for message in recorder.messages] == [0, BATCH, 2 * BATCH, 3 * BATCH]
    assert [x for message in recorder.messages for x in message.time] == [0.001 * k for k in range(n)]
    assert [x for message in recorder.messages for x in message.position] == [
        x for k in range(n) for x in (float(k), k + 0.5)
    ]
    assert [x for message in recorder.messages for x in message.command_raw] == [
        x for k in range(n) for x in (float(k), -1.0)
    ]
    assert [x for message in recorder.messages for x in message.command] == [
        x for k in range(n) for x in (0.5 * k, -1.0)
    ]
    assert recorder.messages[1].header.stamp.to_nsec() == 20_000_000
    assert recorder.messages[0].joint_names == ["a", "b"]


def test_a_change_of_interface_begins_a_new_message():
    recorder = Recorder()
    for k in range(5):
        recorder.cycle(k)
    recorder.log.complete()
    recorder.row = ["position", "none"], *recorder.row[1:]
    for k in range(5, 8):
        recorder.cycle(k)
    recorder.log.complete()
    recorder.log.flush()
    assert [(message.first_cycle, message.n_cycles, message.command_interface) for message in recorder.messages] == [
        (0, 5, ["effort", "effort"]),
        (5, 3, ["position", "none"]),
    ]


def test_completing_or_flushing_twice_adds_nothing():
    recorder = Recorder()
    recorder.cycle(0)
    for _ in range(2):
        recorder.log.complete()
        recorder.log.flush()
    assert [message.n_cycles for message in recorder.messages] == [1]
