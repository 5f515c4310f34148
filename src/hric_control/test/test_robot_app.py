"""The robot with manager, log, clock and counts, without a master."""

import gc
import importlib
import logging
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from recorded_calls import RecordingRobotHW

from hric_control.controller import Controller
from hric_control.diagnostics import Diagnostics
from hric_control.hardware_interface import EffortJointInterface
from hric_control.manager.controller_manager import import_controllers
from hric_control.robot_app import RobotApp
from hric_control.robot_settings import robot_hw_type
from hric_core.errors import DescriptionError, HricError, ParameterError, UnknownNameError
from hric_core.local.node import LocalNode

sys.path.append(str(Path(__file__).parent))
toy = importlib.import_module("double_integrator_robot")


class Push(Controller):
    """A constant effort on both joints."""

    def init(self, robot_hw, root_node, controller_node):
        self.joints = robot_hw.get(EffortJointInterface).group()
        self.effort = controller_node.param("effort", 1.0)
        self.starts = []

    def starting(self, time):
        self.starts.append(time)

    def update(self, time, period):
        self.joints.set_command([self.effort, -self.effort])


class Run:
    """RobotApp without ROS on the toy robot; all messages are recorded by topic."""

    def __init__(self, parameters=None, effort=1.0, start=True):
        self.node = LocalNode({"robot_description": toy.URDF, "push": {"type": "test/Push", "effort": effort}})
        self.hw_node = LocalNode({"real_time_factor": 0.0, **(parameters or {})})
        self.messages = {}
        self.node.tap(lambda topic, message, time: self.messages.setdefault(topic, []).append((time, message)))
        self.app = RobotApp(self.node, self.hw_node, hw=toy.ToyRobot())
        self.app.manager._classes["test/Push"] = Push
        if start:
            self.app.manager.load("push")
            self.app.manager.switch(["push"], [])

    def of(self, topic):
        return [message for _, message in self.messages.get(topic, [])]


@pytest.fixture
def run():
    runs = []

    def make(*args, **options):
        runs.append(Run(*args, **options))
        return runs[-1]

    yield make
    for one in runs:
        one.app.shutdown()
        assert one.app.hw.plant.closed
        assert not one.node.services()


def test_a_duration_is_run_exactly_and_runs_follow_each_other(run):
    one = run()
    one.app.run(0.5)
    assert (one.app.loop.cycles, one.app.loop.time, one.app.hw.plant.steps) == (500, 0.5, 500)
    one.app.run(0.001)
    assert one.app.loop.time == 0.501
    one.app.run(0.0)
    assert one.app.loop.time == 0.501


def test_the_log_has_every_cycle_with_what_was_read_and_sent(run):
    one = run(effort=12.0)  # above the limit of 10 N m
    one.app.run(0.533)
    rows = one.of("/control_log")
    assert [message.first_cycle for message in rows] == list(range(0, 533, 20))
    times = [time for message in rows for time in message.time]
    assert times == pytest.approx([0.001 * k for k in range(533)])
    positions = [x for message in rows for x in message.position[::2]]
    assert positions[0] == 0.0
    # Semi-implicit Euler under 10 N m on 1 kg m^2: after k steps q = 10 dt^2 k (k + 1) / 2, until the velocity limit of
    # 3 rad/s.
    assert positions[200] == pytest.approx(10.0 * 1e-6 * 200 * 201 / 2)
    assert {x for message in rows for x in message.command_raw[::2]} == {12.0}
    assert rows[0].command[0] == 10.0
    assert rows[0].command_interface == ["effort", "effort"]
    assert rows[0].header.stamp.to_sec() == 0.0


def test_the_clock_ticks_at_100_hz_of_robot_time_and_the_counts_come_each_second_and_at_the_end(run):
    one = run(effort=12.0)
    one.app.run(2.005)
    clock = [message.clock.to_nsec() for message in one.of("/clock")]
    assert clock == [10_000_000 * k for k in range(1, 201)]  # 0 is no time to ROS
    counts = one.of("/limit_counts")
    assert [message.cycles for message in counts] == [0, 1000, 2000, 2005]
    assert counts[-1].effort[0] > 0
    assert counts[-1].velocity_ratio_max[0] >= 1.0
    assert one.of("/controller_manager/statistics")


def test_a_headless_run_spends_nothing_on_pairs_of_clocks(run):
    one = run()
    one.app.run(0.1)
    assert not any(topic.endswith("hric/clock") for topic in one.messages)


def test_the_log_can_be_switched_off_by_parameter(run):
    one = run({"control_log": False})
    one.app.run(0.1)
    assert not one.of("/control_log")
    with pytest.raises(ParameterError, match="control_log is 'no'; valid: true or false"):
        Run({"control_log": "no"})


def test_the_hook_sees_every_cycle_before_the_controllers_and_may_stop_the_run(run):
    one, seen = run(), []

    def hook(time):
        seen.append(time)
        if len(seen) == 30:
            one.app.stop()

    one.app.run(None, hook)
    assert seen == pytest.approx([0.001 * k for k in range(30)])
    assert sum(message.n_cycles for message in one.of("/control_log")) == 30


def test_a_reset_between_two_runs_keeps_time_and_restarts_the_controllers(run):
    one = run()
    one.app.run(0.1)
    one.app.hw.reset()
    one.app.run(0.1)
    controller = one.app.manager._loaded["push"].controller
    assert controller.starts == pytest.approx([0.0, 0.1])
    assert one.app.loop.time == 0.2
    rows = one.of("/control_log")
    assert [message.first_cycle for message in rows] == list(range(0, 200, 20))


def test_two_runs_are_bit_identical(run):
    logs = []
    for _ in range(2):
        one = run(effort=3.0)
        one.app.run(0.3)
        logs.append(
            [
                (topic, message)
                for topic in sorted(one.messages)
                for message in one.of(topic)
                if "statistics" not in topic
            ]
        )
    assert len(logs[0]) > 40
    assert logs[0] == logs[1]


def test_a_controller_started_by_a_request_from_the_hook_time_on_moves_the_robot(run):
    one = run(start=False)
    one.app.run(0.05)
    assert one.app.hw.plant.q.tolist() == [0.0, 0.0]
    one.app.manager.load("push")
    one.app.manager.switch(["push"], [])
    one.app.run(0.05)
    assert one.app.hw.plant.q[0] > 0.0


def test_a_paced_run_gives_the_collector_back_as_it_was(run):
    before = gc.get_threshold(), gc.get_freeze_count()
    run({"real_time_factor": 5.0}).app.run(0.05)
    assert (gc.get_threshold(), gc.get_freeze_count()) == before


def test_an_error_of_the_robot_ends_the_run_and_the_log_is_complete_up_to_it(run):
    one = run()

    def broken():
        if one.app.loop.cycles == 33:
            raise RuntimeError("engine failed")

    one.app.hw.plant.step = broken
    with pytest.raises(RuntimeError, match="engine failed"):
        one.app.run(1.0)
    assert sum(message.n_cycles for message in one.of("/control_log")) == 34


def test_the_robot_type_is_the_parameter_or_else_the_descriptions():
    described = LocalNode({"robot_description": toy.URDF})
    assert robot_hw_type(described, LocalNode()) == "toy/Toy"
    assert robot_hw_type(described, LocalNode({"robot_hw": "other/Robot"})) == "other/Robot"
    with pytest.raises(
        DescriptionError, match="robot_hw is not set and robot_description has no robotSimType; valid: "
    ):
        robot_hw_type(LocalNode(), LocalNode())
    with pytest.raises(UnknownNameError, match="toy/Toy"):
        RobotApp(described, LocalNode())


def test_a_failing_start_releases_the_robot():
    robot = toy.ToyRobot()
    node = LocalNode({"robot_description": toy.URDF})
    with pytest.raises(ParameterError):
        RobotApp(node, LocalNode({"control_log": 1}), hw=robot)
    assert robot.plant.closed


def test_modules_of_configured_controllers_are_imported_and_unknown_types_left_alone():
    node = LocalNode({"a": {"type": "nobody/Knows"}, "b": {"type": 3}, "c": 1})
    assert import_controllers(node) == []


def test_diagnostics_tell_the_loop_and_what_was_limited(run):
    one = run(effort=12.0)
    one.app.run(0.4)
    status = Diagnostics(one.node, "toy", one.app.loop, one.app.limit_counts)
    loop, limits, listeners = status.message().status
    values = {item.key: item.value for item in loop.values}
    assert (loop.name, loop.hardware_id, loop.message) == ("robot: control loop", "toy", "not running")
    assert listeners.name == "robot: listeners" and "queue limit for each [bytes]" in {
        item.key for item in listeners.values
    }
    assert values["cycles"] == "400"
    assert values["robot time [s]"] == "0.400"
    assert limits.level == DiagnosticStatus.WARN
    assert "j1: " in {item.key: item.value for item in limits.values}["effort"]
    assert status.message().status[1].level == DiagnosticStatus.OK  # nothing since the last one


def test_a_new_pace_is_not_called_too_slow_at_once(run):
    one = run({"real_time_factor": 1.0})
    loop = one.app.loop
    status, texts = Diagnostics(one.node, "toy", loop, None), []

    def change(time):
        if not texts:
            for factor in (1.0, 100.0, 100.0, 100.0):
                loop.real_time_factor = factor
                texts.append(status.message().status[0].message)

    loop.after_cycle.append(change)
    one.app.run(0.01)
    assert texts[1:3] == ["running", "running"] and texts[3].startswith("too slow")


@pytest.mark.parametrize("value", [-1.0, "long", True, float("nan")])
def test_a_wait_for_a_listener_that_is_no_time_is_refused(value):
    with pytest.raises(
        ParameterError, match=r"wait_for_log_listener is .*; valid: a finite number of 0 or more \[s of wall time\]"
    ):
        Run({"wait_for_log_listener": value})


def test_a_private_parameter_that_no_robot_reads_is_refused_with_the_nearest_one():
    with pytest.raises(ParameterError, match=r"no parameter 'controllog' .*\(did you mean control_log\?\)"):
        Run({"controllog": False})


def test_parameters_that_an_experiment_gives_to_any_robot_are_accepted_by_one_without_a_plant():
    run = Run({"arm_id": "panda", "plant": {"seed": 1}, "q_start": [0.0, 0.0]})
    run.app.shutdown()


def test_nobody_listening_is_told_and_the_robot_goes_on(caplog):
    node = LocalNode({"robot_description": toy.URDF})  # without a tap
    app = RobotApp(node, LocalNode({"real_time_factor": 0.0, "wait_for_log_listener": 0.02}), hw=toy.ToyRobot())
    with caplog.at_level(logging.WARNING, "hric"):
        app.wait_for_log_listener()
    assert "control_log has no subscriber after 0.02 s" in caplog.text


class Bare(RecordingRobotHW):
    """Robot without optional attributes, which runs three cycles."""

    def run(self, on_cycle):
        for k in range(3):
            on_cycle(0.001 * k, 0.001, False)


def test_a_robot_that_has_nothing_optional_runs_without_clock_log_counts_and_services_of_a_simulation():
    node = LocalNode()
    app = RobotApp(node, node, hw=Bare())
    assert (app.simulated, app.loop, app.log) == (False, None, None)
    app.run()
    assert app.cycles == 3
    assert not {"/clock", "/control_log", "/limit_counts"} & set(node.topics())
    assert not [name for name in node.services() if name.startswith("/sim")]
    assert app.limit_counts().total == 0
    with pytest.raises(HricError, match=r"Bare\w* has no robot time, so run\(\) cannot have a duration"):
        app.run(1.0)
    app.shutdown()
