"""Participants in a robot's plant: a pusher, which another package exports, and a robot of two masses."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from double_integrator_robot import ToyRobot

from hric_control.robot_app import RobotApp
from hric_core import plugins
from hric_core.errors import HricError, ParameterError
from hric_core.local.node import LocalNode

PUSHER = """
from hric_core.errors import ParameterError
from hric_control.sim.participants import Participant

LOG = []

class Pusher(Participant):
    def __init__(self, name, plant, node, config):
        if set(config) != {"force"}:
            raise ParameterError(f"{name}: valid: force")
        self.plant, self.force = plant, config["force"]

    def reset(self):
        LOG.append("reset")

    def act(self, time):
        LOG.append(time)
        self.plant.apply_wrench("one", (self.force, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.001)

    def close(self):
        LOG.append("close")
"""
EXPORT = '<export><hric_control plugin="${prefix}/plugins.xml"/></export>'


@pytest.fixture(autouse=True)
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Package that exports the pusher as a plugin."""
    (tmp_path / "package.xml").write_text(f"<package format='3'><name>lab</name>{EXPORT}</package>")
    (tmp_path / "plugins.xml").write_text(
        '<library path="lib"><class name="lab/Pusher" type="lab_pusher:Pusher"'
        ' base_class_type="hric_control::Participant"/></library>'
    )
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/lab_pusher.py").write_text(PUSHER)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    plugins.clear_cache()
    yield
    plugins.clear_cache()
    sys.modules.pop("lab_pusher", None)
    sys.path[:] = [path for path in sys.path if path != str(tmp_path / "lib")]


def app(**participants: Any) -> RobotApp:
    node = LocalNode({"robot": {"real_time_factor": 0.0, "participants": participants}})
    return RobotApp(node, node.child("robot"), hw=ToyRobot())


def test_it_acts_before_each_step_at_the_time_of_its_beginning_and_goes_with_the_robot() -> None:
    robot = app(door={"type": "lab/Pusher", "force": 2.0})
    log = sys.modules["lab_pusher"].LOG
    robot.run(0.003)
    assert log == [0.0, 0.001, 0.002]
    wrenches = robot.hw.plant.wrenches
    assert [(body, force[0], steps) for body, force, _, _, _, steps in wrenches] == [("one", 2.0, k) for k in range(3)]
    robot.shutdown()
    assert log[-1] == "close" and robot.hw.plant.closed


def test_a_reset_of_the_robot_is_one_of_the_participants_and_a_new_pose_is_not() -> None:
    robot = app(door={"type": "lab/Pusher", "force": 2.0})
    log = sys.modules["lab_pusher"].LOG
    robot.hw.set_configuration([0.1, 0.0])
    assert log == []
    robot.hw.reset()
    assert log == ["reset"]
    robot.shutdown()


def test_whoever_owns_the_clock_gives_all_the_epoch_of_their_stamps() -> None:
    robot = app(door={"type": "lab/Pusher", "force": 2.0}, gate={"type": "lab/Pusher", "force": 1.0})
    participants = robot.hw._participants
    assert [participant.epoch for participant in participants._all] == [0.0, 0.0]
    participants.set_epoch(1.7e9)
    assert [participant.epoch for participant in participants._all] == [1.7e9, 1.7e9]
    robot.shutdown()


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"door": {"type": "lab/Puller"}}, HricError, "no hric_control::Participant 'lab/Puller'"),
        ({"door": {"type": "lab/Pusher"}}, ParameterError, "door: valid: force"),
        ({"door": 3}, ParameterError, "robot/participants is .* valid: a mapping of names"),
    ],
)
def test_what_is_no_participant_is_refused_and_nothing_stays(
    given: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        app(first={"type": "lab/Pusher", "force": 1.0}, **given)
