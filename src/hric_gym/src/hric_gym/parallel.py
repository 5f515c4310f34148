"""PettingZoo environment in which the robot and the person are two agents."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hric_core.errors import HricError, check_known
from hric_gym.environment import CollaborationEnv
from hric_gym.spaces import Values, as_values, dict_space

try:
    from pettingzoo import ParallelEnv
except ImportError:
    raise HricError("two agents need PettingZoo, which is not installed:  scripts/setup --with learning") from None

ROBOT, PERSON = "robot", "person"
SHOWN = ("person_q", "person_dq", "person_root", "hand_position", "separation", "ee_position", "goal", "force_share")
"""Fields of the robot's observation that are also in the person's."""


class CollaborationParallelEnv(ParallelEnv):
    """Environment of one task with the agents `robot` and `person`, who act at the same time.

    The robot acts as in `CollaborationEnv`. The person moves the target of their hand; their observation has
    `hand_goal`, the position at which they want their hand to be. The robot's reward is that of `CollaborationEnv`; the
    person's is -distance of their hand from `hand_goal` [m], minus a tenth of the cost `effort`, the largest share of
    their joint strength [1].

    Args:
        task: name of a task.
        settings: further arguments of `CollaborationEnv`, except `person` and `trial`.

    Raises:
        HricError: a name does not exist, or the task cannot run with these arguments.
    """

    metadata: Mapping[str, Any] = {"name": "hric_collaboration_v0", "render_modes": ["rgb_array"]}

    def __init__(self, task: str = "HandGuidance", **settings: Any) -> None:
        if given := sorted({"person", "trial"} & {*settings}):
            raise HricError(
                f"argument {', '.join(given)}: the person is an agent here; valid: neither person nor trial"
            )
        self._env = CollaborationEnv(task, **settings, person="policy")
        self.metadata = {**self.metadata, "render_fps": self._env.metadata["render_fps"]}
        self.render_mode = self._env.render_mode
        self.possible_agents = [ROBOT, PERSON]
        self.agents: list[str] = []
        values, _ = self._env.reset(seed=0)
        self.observation_spaces = {agent: dict_space(value) for agent, value in self._values(values).items()}
        self.action_spaces = {ROBOT: self._env.action_space, PERSON: self._env.person_space}

    def observation_space(self, agent: str) -> Any:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Any:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def _values(self, values: Values) -> dict[str, Values]:
        hand_goal = as_values({"hand_goal": self._env.hand_goal()})
        return {ROBOT: values, PERSON: {name: values[name] for name in SHOWN} | hand_goal}

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Begin an episode; return observations and infos by agent.

        Args:
            seed: as in `CollaborationEnv.reset`.
            options: without effect.
        """
        values, info = self._env.reset(seed=seed)
        self.agents = list(self.possible_agents)
        return self._values(values), {agent: dict(info) for agent in self.agents}

    def step(self, actions: dict[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
        """Execute an action of each agent; return observations, rewards, terminated, truncated and infos by agent.

        Raises:
            HricError: no episode is running, an agent has no action, or as in `CollaborationEnv.step`.
        """
        if not self.agents:
            raise HricError("no episode is running: it has ended, or none has begun; call reset() first")
        if missing := [
            agent for agent in self.agents if not isinstance(actions, Mapping) or actions.get(agent) is None
        ]:
            raise HricError(
                f"no action of {', '.join(missing)}; valid: one of each agent, {', '.join(self.agents)}, by name"
            )
        check_known("agent", actions, self.agents)
        values, reward, ended, late, info = self._env.step_with(actions[ROBOT], actions[PERSON])
        observations, agents = self._values(values), self.agents
        away = observations[PERSON]["hand_position"] - observations[PERSON]["hand_goal"]
        own = -float(np.linalg.norm(away)) - 0.1 * info["costs"].get("effort", 0.0)
        rewards = {ROBOT: reward, PERSON: own}
        ends, limits = (dict.fromkeys(agents, value) for value in (ended, late))
        infos = {agent: dict(info) for agent in agents}
        if ended or late:
            self.agents = []
        return observations, rewards, ends, limits, infos

    def render(self) -> Any:
        """Return a picture of the scene, see `CollaborationEnv.render`."""
        return self._env.render()

    def close(self) -> None:
        """Release the simulation."""
        self._env.close()
