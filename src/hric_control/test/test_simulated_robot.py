"""The behaviour of all simulated robots: plant, loop, reset and changes of the pose."""

import math

import pytest
from double_integrator_robot import DoubleIntegrator, ToyRobot

from hric_control.sim.simulated_robot import PlantInput, SimulatedRobot
from hric_core import plugins
from hric_core.errors import CommandError, HricError
from hric_core.local.node import LocalNode

DESCRIPTION = '<robot name="r"><link name="base"/></robot>'


@pytest.fixture
def robot() -> ToyRobot:
    hw = ToyRobot()
    hw.init(LocalNode(), LocalNode({"real_time_factor": 0.0}))
    return hw


@pytest.mark.parametrize("q", [[0.1], [0.1, 0.2, 0.3], [0.1, math.nan], [math.inf, 0.2]])
def test_a_pose_that_is_none_is_refused_with_the_joints_and_nothing_moves(robot: ToyRobot, q: list[float]) -> None:
    for put in (robot.reset, robot.set_configuration):
        with pytest.raises(CommandError, match="2 finite numbers, for j1, j2; got"):
            put(q)
    assert robot.plant.q.tolist() == [0.0, 0.0] and robot.plant.resets == 0


def test_a_reset_goes_to_the_pose_given_or_to_the_start_and_a_configuration_leaves_the_world(robot: ToyRobot) -> None:
    robot.reset([0.1, 0.2])
    assert robot.states.position == [0.1, 0.2]
    robot.set_configuration([0.3, 0.4])
    assert robot.states.position == [0.3, 0.4] and robot.plant.resets == 1
    robot.reset()
    assert robot.states.position == [0.0, 0.0] and robot.plant.resets == 2


def test_time_and_period_are_those_of_the_loop(robot: ToyRobot) -> None:
    def on_cycle(time: float, period: float, reset: bool) -> bool:
        assert (time, period) == (robot.time, robot.period)
        if robot.loop.cycles == 4:
            robot.stop()
        return False  # leaving a mode is nothing to a robot that has one only

    robot.run(on_cycle)
    assert (robot.time, robot.epoch, robot.plant.steps) == (0.005, 0.0, 5)


def test_what_fails_after_the_plant_was_made_closes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def make(urdf: str, names: list[str], config: dict[str, float]) -> DoubleIntegrator:
        made.append(DoubleIntegrator(names, 0.001))
        return made[-1]

    monkeypatch.setattr(plugins, "find", lambda base, name: make)

    def build(real_time_factor: float, failure: Exception | None) -> SimulatedRobot:
        robot = SimulatedRobot()
        node = LocalNode({"real_time_factor": real_time_factor})
        with robot._new_plant(node, PlantInput(DESCRIPTION, ["j1", "j2"], {"rotor_inertia": {"j2": 0.3}})):
            if failure is not None:
                raise failure
        return robot

    for factor, failure in ((1.0, HricError("no such limit")), (1.0, KeyboardInterrupt()), (-1.0, None)):
        with pytest.raises((HricError, KeyboardInterrupt)):
            build(factor, failure)
        assert made[-1].closed
    robot = build(1.0, None)
    assert robot.plant is made[-1] and not made[-1].closed
    assert robot.rotor_inertia == (0.0, 0.3)
