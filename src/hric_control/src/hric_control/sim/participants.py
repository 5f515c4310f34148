"""Who else acts in the robot's plant: a person beside the arm, a door that opens. Found by name, as plants are."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from hric_control.plant import Plant
from hric_core import plugins
from hric_core.errors import ParameterError
from hric_core.node import Node


class Participant(ABC):
    """Somebody or something with a will of its own. Constructed, after the plant, as
    `ParticipantClass(name, plant, node, config)`:

        name: of what it spawns and publishes.
        plant: the robot's.
        node: the robot's private names; a child of it, or `node.beside`, to publish.
        config: its parameters, `type` not among them.

    Attributes:
        epoch: time of the run at which robot time was 0 [s]: what it publishes is stamped with the sum of both.
    """

    epoch = 0.0

    @abstractmethod
    def reset(self) -> None:
        """The plant was put back to its start, or has just been made; robot time goes on."""

    @abstractmethod
    def act(self, time: float) -> None:
        """Act in the coming step; in the loop, so it must not block.

        Args:
            time: robot time of the state at its beginning [s].
        """

    def close(self) -> None:  # noqa: B027  (who holds nothing need not say so)
        """Take back what was advertised; the plant goes by itself."""


class Participants:
    """All of a robot, from its private parameter `participants`: {name: {type: package/Class, ...}}.

    Args:
        plant: as it was made.
        node: where the robot's private parameters are.

    Raises:
        HricError: a type that does not exist, or parameters that it refuses; those before it are closed.
    """

    def __init__(self, plant: Plant, node: Node) -> None:
        self._plant = plant
        self._all: list[Participant] = []
        try:
            for name, config in _mappings(node).items():
                given = {key: value for key, value in config.items() if key != "type"}
                participant = plugins.find(plugins.PARTICIPANT, config.get("type", ""))
                self._all.append(participant(name, plant, node, given))
        except BaseException:
            self.close()
            raise

    def set_epoch(self, epoch: float) -> None:
        """Let all stamp what they publish with robot time plus this [s]; from any thread."""
        for participant in self._all:
            participant.epoch = epoch

    def reset(self) -> None:
        """The plant was put back to its start."""
        for participant in self._all:
            participant.reset()

    def step(self, time: float) -> None:
        """A step of the plant, in which all act; time: robot time at its beginning [s]."""
        for participant in self._all:
            participant.act(time)
        self._plant.step()

    def close(self) -> None:
        """All go."""
        while self._all:
            self._all.pop().close()


def _mappings(node: Node) -> Mapping[str, Mapping[str, Any]]:
    given = node.param("participants", {})
    if not isinstance(given, Mapping) or not all(isinstance(config, Mapping) for config in given.values()):
        where = node.resolve("participants")
        raise ParameterError(f"{where} is {given!r}; valid: a mapping of names to {{type: package/Class, ...}}")
    return given
