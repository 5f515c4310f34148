"""Participants in the robot's plant, such as a person near the arm or a door; plugins found by name."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

from hric_control.plant import Plant
from hric_core import plugins
from hric_core.errors import ParameterError
from hric_core.node import Node


class Participant(ABC):
    """Agent that acts in the robot's plant.

    Constructed after the plant as `ParticipantClass(name, plant, node, config)`:
        name: name of its model and topics.
        plant: the robot's plant.
        node: the robot's private names; a child of it, or `node.beside`, to publish.
        config: its parameters, without `type`.

    Attributes:
        epoch: time of the run at which robot time was 0 [s]; added to robot time in its stamps.
    """

    epoch = 0.0

    @abstractmethod
    def reset(self) -> None:
        """Reset after the plant was reset or created; robot time goes on."""

    @abstractmethod
    def act(self, time: float) -> None:
        """Act in the coming step. Runs in the loop, so it must not block.

        Args:
            time: robot time of the state at the start of the step [s].
        """

    def close(self) -> None:  # noqa: B027  (a participant without resources needs no override)
        """Unregister topics and services; the plant is closed elsewhere."""


class Participants:
    """Participants of a robot, from its private parameter `participants`: {name: {type: package/Class, ...}}.

    Args:
        plant: plant after its construction.
        node: node with the robot's private parameters.

    Raises:
        HricError: a type does not exist, or refuses its parameters; participants constructed before it are closed.
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
        """Set the offset from robot time to the stamps of all participants [s]. May be called from any thread."""
        for participant in self._all:
            participant.epoch = epoch

    def reset(self) -> None:
        """Reset all participants after the plant was reset."""
        for participant in self._all:
            participant.reset()

    def step(self, time: float) -> None:
        """Let all participants act, then step the plant; time: robot time at the start of the step [s]."""
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
