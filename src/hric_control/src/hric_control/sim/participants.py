"""Participants: plugins that act in a simulated robot's plant, such as a simulated person near the arm or a door."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

from hric_control.plant import Plant
from hric_core import plugins
from hric_core.errors import ParameterError
from hric_core.node import Node


class Participant(ABC):
    """Base class of a participant: a simulated person or object that acts in each step of a robot's plant.

    Constructed after the plant as `ParticipantClass(name, plant, node, config)`:
        name: name of the participant's model and topics.
        plant: the robot's plant.
        node: node of the robot's private namespace; the participant publishes through a child of it, or through names
            from `node.beside`.
        config: parameters of the participant, without `type`.

    Attributes:
        epoch: offset from robot time to the participant's message stamps [s].
    """

    epoch = 0.0

    @abstractmethod
    def reset(self) -> None:
        """Reset the participant, after the plant was created or reset; robot time is not reset."""

    @abstractmethod
    def act(self, time: float) -> None:
        """Act on the plant for the next step. Called in the control loop, so it must not block.

        Args:
            time: robot time of the state at the start of the step [s].
        """

    def close(self) -> None:  # noqa: B027  (a participant without resources needs no override)
        """Unregister topics and services; the plant is closed by its owner."""


class Participants:
    """All participants of a robot, constructed from its private parameter `participants`.

    The parameter is a mapping {name: {type: package/Class, ...}}.

    Args:
        plant: the robot's plant, already constructed.
        node: node with the robot's private parameters.

    Raises:
        HricError: a type does not exist, or refuses its parameters; then all participants are closed.
    """

    def __init__(self, plant: Plant, node: Node) -> None:
        self._plant = plant
        self._all: list[Participant] = []
        try:
            for name, config in _mappings(node).items():
                parameters = {key: value for key, value in config.items() if key != "type"}
                participant = plugins.find(plugins.PARTICIPANT, str(config.get("type", "")))
                self._all.append(participant(name, plant, node, parameters))
        except BaseException:
            self.close()
            raise

    def set_epoch(self, epoch: float) -> None:
        """Set the offset from robot time to the message stamps of all participants [s]; from any thread."""
        for participant in self._all:
            participant.epoch = epoch

    def reset(self) -> None:
        """Reset all participants; called after the plant was reset."""
        for participant in self._all:
            participant.reset()

    def step(self, time: float) -> None:
        """Let all participants act, then step the plant; `time`: robot time at the start of the step [s]."""
        for participant in self._all:
            participant.act(time)
        self._plant.step()

    def close(self) -> None:
        """Close all participants, in reverse order."""
        while self._all:
            self._all.pop().close()


def _mappings(node: Node) -> Mapping[str, Mapping[str, object]]:
    participants = node.param("participants", {})
    if not isinstance(participants, Mapping) or not all(
        isinstance(config, Mapping) for config in participants.values()
    ):
        where = node.resolve("participants")
        raise ParameterError(f"{where} is {participants!r}; valid: a mapping of names to {{type: package/Class, ...}}")
    return participants
