import numpy as np
import pytest

from hric_control.hardware_interface import (
    EffortJointInterface,
    InterfaceManager,
    JointCommands,
    JointStateInterface,
    JointStates,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_core.errors import CommandError, HricError, UnknownNameError

NAMES = ["j1", "j2", "j3"]


@pytest.fixture
def states() -> JointStates:
    states = JointStates(NAMES)
    states.position[:], states.velocity[:], states.effort[:] = [1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]
    return states


def test_a_group_reads_in_the_order_asked_for(states: JointStates) -> None:
    group = JointStateInterface(states).group(["j3", "j1"])
    assert group.position.tolist() == group.positions() == [3.0, 1.0]
    assert group.velocity.tolist() == group.velocities() == [6.0, 4.0]
    assert group.effort.tolist() == group.efforts() == [9.0, 7.0]
    assert len(group) == 2 and group.position.shape == (2,)


def test_a_group_of_all_joints_gives_copies_of_the_state(states: JointStates) -> None:
    group = JointStateInterface(states).group()
    taken = group.positions()
    taken[0] = 99.0
    group.position[0] = 99.0
    assert states.position[0] == 1.0


def test_a_handle_is_a_view_of_one_joint(states: JointStates) -> None:
    commands = JointCommands(states)
    handle = EffortJointInterface(commands).handle("j2")
    assert (handle.position, handle.velocity, handle.effort, handle.command) == (2.0, 5.0, 8.0, 0.0)
    states.position[1] = 2.5
    handle.command = 11.0
    assert handle.position == 2.5 and commands.value == [0.0, 11.0, 0.0]


@pytest.mark.parametrize("values", [[1, 2.0], (1.0, 2.0), np.array([1.0, 2.0])])
def test_a_command_is_set_from_any_sequence(states: JointStates, values) -> None:
    commands = JointCommands(states)
    group = EffortJointInterface(commands).group(["j3", "j1"])
    group.command = values
    assert commands.value == [2.0, 0.0, 1.0] and group.command.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ([1.0], r"command has 1 values for 3 joints \(j1, j2, j3\)"),
        ([1.0, float("nan"), 0.0], "command is not finite: j2=nan"),
        ([float("inf"), 0.0, float("-inf")], "j1=inf, j3=-inf"),
    ],
)
def test_a_bad_command_is_refused_by_name_and_the_one_before_stays(
    states: JointStates, values: list[float], reason: str
) -> None:
    commands = JointCommands(states)
    group = EffortJointInterface(commands).group()
    group.set_command([1.0, 2.0, 3.0])
    with pytest.raises(CommandError, match=reason):
        group.set_command(values)
    assert commands.value == [1.0, 2.0, 3.0]
    with pytest.raises(CommandError, match="command of j1 is not finite"):
        EffortJointInterface(commands).handle("j1").command = float("nan")


@pytest.mark.parametrize("names", [[], [""], ["j1", "j1"]])
def test_bad_sets_of_names_are_refused(states: JointStates, names: list[str]) -> None:
    with pytest.raises(HricError, match="joint names must"):
        JointStates(names)
    with pytest.raises(HricError, match="joint names must"):
        JointStateInterface(states).group(names)


def test_an_unknown_joint_is_refused_with_interface_and_joints(states: JointStates) -> None:
    with pytest.raises(UnknownNameError, match="no joint 'j9' in PositionJointInterface; valid: j1, j2, j3"):
        PositionJointInterface(JointCommands(states)).handle("j9")


def test_an_interface_may_offer_some_of_the_joints_only(states: JointStates) -> None:
    interface = VelocityJointInterface(JointCommands(states), ["j2"])
    assert interface.names == ("j2",) and interface.group().names == ("j2",)
    with pytest.raises(UnknownNameError, match="valid: j2"):
        interface.group(["j1"])
    with pytest.raises(UnknownNameError, match="no joint 'j9'"):
        VelocityJointInterface(JointCommands(states), ["j9"])


def test_asking_a_command_interface_claims_and_reading_states_does_not(states: JointStates) -> None:
    effort, reader = EffortJointInterface(JointCommands(states)), JointStateInterface(states)
    effort.group(["j1", "j2"])
    effort.handle("j3")
    reader.group()
    assert effort.claims == {"j1", "j2", "j3"} and reader.claims == frozenset()
    effort.clear_claims()
    assert effort.claims == frozenset()


def test_a_refused_request_claims_nothing(states: JointStates) -> None:
    effort = EffortJointInterface(JointCommands(states))
    with pytest.raises(UnknownNameError):
        effort.group(["j1", "j9"])
    assert effort.claims == frozenset()


def test_interfaces_are_found_by_type_and_a_missing_one_is_told_with_those_offered(states: JointStates) -> None:
    manager = InterfaceManager()
    effort = EffortJointInterface(JointCommands(states))
    manager.register_interface(effort)
    assert manager.get(EffortJointInterface) is effort and manager.interfaces() == (effort,)
    assert not manager.has(PositionJointInterface)
    with pytest.raises(
        UnknownNameError,
        match="no hardware interface 'PositionJointInterface' in InterfaceManager; valid: EffortJointInterface",
    ):
        manager.get(PositionJointInterface)
    with pytest.raises(HricError, match="EffortJointInterface is registered already"):
        manager.register_interface(EffortJointInterface(JointCommands(states)))


def test_the_interfaces_carry_ros_controls_names() -> None:
    for kind in (JointStateInterface, EffortJointInterface, VelocityJointInterface, PositionJointInterface):
        assert kind.cpp_name == f"hardware_interface::{kind.__name__}"
