"""The robot node as a process under a real master, with a toy robot from a package of its own."""

import contextlib
import importlib
import itertools
import os
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest
from real_master import end_nodes

pytestmark = pytest.mark.alone

HERE = Path(__file__).parent
NODE = HERE.parent / "nodes" / "robot"
sys.path.append(str(HERE))
toy = importlib.import_module("double_integrator_robot")

PACKAGE = (
    '<package format="3"><name>toy_robot</name><export><hric_control '
    'plugin="${prefix}/plugins.xml"/></export></package>'
)
PLUGINS = f"""<library path="{HERE}">
<class name="toy/Toy" type="double_integrator_robot:ToyRobot" base_class_type="hric_control::RobotHW"/></library>"""


@pytest.fixture
def start(ros, tmp_path):
    import rospy

    rospy.set_param("/toy/robot_description", toy.URDF)
    (tmp_path / "package.xml").write_text(PACKAGE)
    (tmp_path / "plugins.xml").write_text(PLUGINS)
    environment = os.environ | {
        "ROS_PACKAGE_PATH": f"{tmp_path}:{os.environ.get('ROS_PACKAGE_PATH', '')}",
        "ROS_NAMESPACE": "/toy",
    }
    processes = []

    def launch(*arguments):
        processes.append(
            subprocess.Popen(
                [sys.executable, str(NODE), *arguments],
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
        )
        return processes[-1]

    yield launch
    end_nodes(*processes)


@contextlib.contextmanager
def listening(topic, kind):
    import rospy

    seen = []
    subscriber = rospy.Subscriber(
        topic, kind, lambda message: seen.append((time.monotonic(), message)), queue_size=None
    )
    try:
        yield seen
    finally:
        subscriber.unregister()


def caller(name, kind):
    import rospy

    rospy.wait_for_service(name)
    return rospy.ServiceProxy(name, kind)


def wait(condition, timeout=30.0):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.005)


def test_a_running_robot_serves_logs_pauses_steps_and_ends(start):
    from diagnostic_msgs.msg import DiagnosticArray
    from rosgraph_msgs.msg import Clock
    from std_srvs.srv import Empty

    from hric_msgs.msg import ControlLog, JointLimitCounts
    from hric_msgs.srv import StepSimulation

    with (
        listening("/clock", Clock) as clock,
        listening("/toy/control_log", ControlLog) as log,
        listening("/toy/limit_counts", JointLimitCounts) as counts,
        listening("/diagnostics", DiagnosticArray) as diagnostics,
    ):
        process = start()
        pause, step = caller("/toy/sim/pause_physics", Empty), caller("/toy/sim/step", StepSimulation)
        wait(lambda: log)
        begin = len(clock)
        time.sleep(3.0)
        pause()
        ticks = len(clock) - begin
        robot_time = (clock[-1][1].clock - clock[begin][1].clock).to_sec()
        time.sleep(1.0)  # for what is under way
        before = clock[-1][1].clock
        time.sleep(0.2)
        assert clock[-1][1].clock == before  # time stands
        answer = step(50)
        assert answer.success
        assert step(1).time == pytest.approx(answer.time + 0.001)
        # 100 Hz of robot time; a tick that waited gives way to the next one, which on a busy machine happens often.
        assert 40.0 * robot_time < ticks <= 100.0 * robot_time + 2.0
        caller("/toy/sim/unpause_physics", Empty)()
        wait(lambda: clock[-1][1].clock.to_sec() > answer.time + 0.2)
        refused = step(1)
        assert (refused.success, "not paused" in refused.status_message) == (False, True)
        wait(lambda: counts and diagnostics)
        process.send_signal(signal.SIGINT)
        assert process.wait(30.0) == 0
        time.sleep(0.1)
    messages = [message for _, message in log]
    cycles = [message.first_cycle + i for message in messages for i in range(message.n_cycles)]
    assert cycles == list(range(cycles[0], cycles[0] + len(cycles)))
    assert cycles[-1] * 0.001 == pytest.approx(messages[-1].time[-1])
    assert len(cycles) > 1500
    names = {status.name for _, array in diagnostics for status in array.status}
    assert {"toy: control loop", "toy: joint limits"} <= names


def test_a_listener_that_comes_late_gets_the_first_cycle_when_the_robot_is_told_to_wait_for_it(start):
    from hric_msgs.msg import ControlLog
    from hric_msgs.srv import StepSimulation

    process = start("_wait_for_log_listener:=120")
    caller("/toy/sim/step", StepSimulation)  # the robot is there
    time.sleep(0.3)
    with listening("/toy/control_log", ControlLog) as log:
        wait(lambda: log)
        process.send_signal(signal.SIGINT)
        assert process.wait(30.0) == 0
    assert log[0][1].first_cycle == 0


def test_a_robot_that_waits_for_a_listener_ends_at_once_when_asked_to(start):
    from hric_msgs.srv import StepSimulation

    process = start("_wait_for_log_listener:=60")
    caller("/toy/sim/step", StepSimulation)
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0


def test_an_unpaced_robot_is_fast_and_loses_no_row(start):
    from hric_msgs.msg import ControlLog

    with listening("/toy/control_log", ControlLog) as log:
        process = start("_real_time_factor:=0")
        wait(lambda: len(log) > 20)
        begin, first = time.monotonic(), log[-1][1].first_cycle
        time.sleep(1.0)
        factor = (log[-1][1].first_cycle - first) * 0.001 / (time.monotonic() - begin)
        process.send_signal(signal.SIGTERM)
        assert process.wait(30.0) == 0
        time.sleep(0.2)
    messages = [message for _, message in log]
    cycles = [message.first_cycle + i for message in messages for i in range(message.n_cycles)]
    assert cycles == list(range(cycles[0], cycles[0] + len(cycles)))
    assert factor > 2.0  # far above real time, on any machine


def test_pairs_tell_drivers_the_time_of_the_run_also_while_it_stands(start):
    from std_srvs.srv import Empty

    from hric_msgs.msg import ClockPair

    with listening("/toy/hric/clock", ClockPair) as pairs:
        start("_real_time_factor:=0.5")
        pause = caller("/toy/sim/pause_physics", Empty)
        wait(lambda: len(pairs) > 100)
        (_, first), (heard, last) = pairs[-50], pairs[-1]
        passed = 1e-9 * (last.monotonic - first.monotonic)
        assert (last.run_time - first.run_time).to_sec() / passed == pytest.approx(0.5, abs=0.2)
        assert 10.0 < 49 / passed <= 52.0  # 50 Hz; one that waited gives way to the next
        assert last.scheduled and heard - 5.0 < 1e-9 * last.monotonic <= heard + 0.05  # announced ahead
        assert last.real_time_factor == 0.5
        pause()
        time.sleep(1.0)  # for what is under way
        begin = len(pairs)
        wait(lambda: len(pairs) > begin + 10)
        assert len({message.run_time.to_nsec() for _, message in pairs[begin:]}) == 1


def test_a_new_pace_reaches_drivers_without_a_jump(start):
    from hric_msgs.msg import ClockPair
    from hric_msgs.srv import SetRealTimeFactor

    with listening("/toy/hric/clock", ClockPair) as pairs:
        start("_real_time_factor:=0.5")
        wait(lambda: len(pairs) > 20)
        assert caller("/toy/sim/set_real_time_factor", SetRealTimeFactor)(2.0).success
        wait(lambda: [message for _, message in pairs if message.real_time_factor == 2.0][60:])
        messages = [message for _, message in pairs]
    slopes = [
        (b.run_time - a.run_time).to_sec() / (1e-9 * (b.monotonic - a.monotonic))
        for a, b in itertools.pairwise(messages)
        if b.monotonic > a.monotonic
    ]
    assert all(message.scheduled for message in messages) and min(slopes) >= 0.0 and max(slopes) <= 2.0 + 1e-6
    assert statistics.median(slopes[-30:]) == pytest.approx(2.0, rel=0.1)


def test_an_unpaced_robot_says_so_to_drivers(start):
    from hric_msgs.msg import ClockPair

    with listening("/toy/hric/clock", ClockPair) as pairs:
        start("_real_time_factor:=0")
        wait(lambda: pairs)
    assert pairs[-1][1].real_time_factor == 0.0


def test_a_mistake_at_the_start_is_one_fatal_line_and_exit_code_2(start):
    process = start("_robot_hw:=nobody/Knows")
    output, _ = process.communicate(timeout=20.0)
    assert process.returncode == 2
    assert "no hric_control::RobotHW 'nobody/Knows'" in output
    assert "toy/Toy" in output
    assert "Traceback" not in output
    assert output.count("FATAL") == 1


def test_ctrl_c_during_a_pause_ends_the_robot(start):
    from std_srvs.srv import Empty

    process = start()
    caller("/toy/sim/pause_physics", Empty)()
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0
    assert not [line for line in process.stdout.read().splitlines() if "Traceback" in line or "ERROR" in line]


def test_help_works_without_a_master():
    environment = os.environ | {"ROS_MASTER_URI": "http://127.0.0.1:1"}
    result = subprocess.run(
        [sys.executable, str(NODE), "--help"], env=environment, capture_output=True, text=True, timeout=20.0
    )
    assert result.returncode == 0
    assert "rosrun hric_control robot" in result.stdout
