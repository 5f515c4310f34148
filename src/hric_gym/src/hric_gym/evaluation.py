"""Evaluation of a policy on its own task, over fresh episodes, next to a scripted reach in the same episodes."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit
from tqdm import tqdm

from franka_hw_interface.model import FrankaFrame
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_controllers.policy.network import PolicyNetwork
from hric_core.geometry import FloatArray
from hric_gym.actions import STREAM_SPEED
from hric_gym.environment import CollaborationEnv
from hric_gym.policy_env import PolicyEnv, environment
from hric_gym.tasks import FORCE, SEPARATION
from hric_sweep.statistics.intervals import LEVEL, clopper_pearson

FIRST = 1_000_000
"""Seed of the first episode; training draws all its episodes from one smaller seed."""
PEAK = 1.875
"""Ratio of the largest to the mean speed of the minimum-jerk course [1]."""
LARGEST = 0.01
"""Largest share of episodes in which force or reflex may exceed a limit [1] (project default)."""
REFLEX = "reflex"
POLICY, SCRIPTED, RESTING = "policy", "scripted", "resting"
"""Names of the three ways to move the arm."""
Act = Callable[[Any, dict[str, Any]], Any]
"""Function (observation of the policy, fields of the environment) -> action."""


@dataclass(frozen=True)
class EpisodeResult:
    """Result of one episode.

    Attributes:
        score: sum of the rewards [1].
        success: True if the end effector reached the goal.
        seconds: robot time until the end [s].
        violations: limits that were exceeded: costs, or the reflex of the arm.
        force, separation: largest share of the contact limit, and mean share of the separation distance up to 10 [1].
        reflex: names of the errors with which the control box ended the episode; empty: none.
    """

    score: float
    success: bool
    seconds: float
    violations: frozenset[str]
    force: float
    separation: float
    reflex: str = ""

    @property
    def violated(self) -> bool:
        """True if a force exceeded its limit or a reflex stopped the arm."""
        return bool(self.violations & {FORCE, REFLEX})


class ScriptedReach:
    """Straight line of the end effector to the goal, with the minimum-jerk course of Flash and Hogan (1985).

    Args:
        env: environment.
        speed: largest speed of the end effector [m/s].
    """

    def __init__(self, env: CollaborationEnv, speed: float) -> None:
        hw = env.simulation.app.hw
        assert isinstance(hw, FrankaHWSim), "the environment has refused other robots"
        self._model, self._speed, self._period = hw.model, speed, env.period

    def __call__(self, _: Any, fields: dict[str, Any]) -> FloatArray:
        """Return the action; `fields`: observation of the environment, whose first one begins the motion."""
        position = self._model.pose(FrankaFrame.END_EFFECTOR, fields["command"].tolist())[:3, 3]
        if fields["first"]:
            self._start, self._step = position, 0
        line, self._step = fields["goal"] - self._start, self._step + 1
        duration = PEAK * float(np.linalg.norm(line)) / self._speed
        s = min(1.0, self._step * self._period / duration)
        aim = self._start + line * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        action: FloatArray = np.clip((aim - position) / (self._period * STREAM_SPEED), -1.0, 1.0)
        return action


def played(env: PolicyEnv, act: Act, seed: int) -> EpisodeResult:
    """Return the result of an episode; `env`: as `policy_env.environment` returns it."""
    plain, score, seconds = env.unwrapped, 0.0, 0.0
    observation, info = env.reset(seed=seed)
    violations: set[str] = set()
    forces, separations, ended, first = [0.0], [], False, True
    while not ended:
        action = act(observation, {**env.fields, "first": first})
        observation, reward, over, late, info = env.step(action)
        score, seconds, ended, first = score + reward, seconds + plain.period, over or late, False
        violations |= set(info["violations"]) | ({REFLEX} if info["reflex"] else set())
        forces.append(info["costs"].get(FORCE, 0.0))
        separations.append(min(info["costs"].get(SEPARATION, math.nan), 10.0))
    return EpisodeResult(
        score,
        info["success"],
        seconds,
        frozenset(violations),
        max(forces),
        float(np.mean(separations)),
        info["reflex"],
    )


def evaluated(network: PolicyNetwork, episodes: int, first: int, speed: float) -> dict[str, list[EpisodeResult]]:
    """Return the results of policy and scripted reach in the same episodes, and of the resting arm in a tenth of them.

    Args:
        network: the policy.
        episodes: number of episodes.
        first: seed of the first episode; the others have the seeds after it.
        speed: largest speed of the scripted reach [m/s].
    """
    env = environment(network.contract)
    acts: dict[str, tuple[Act, int]] = {
        POLICY: (lambda observation, _: network(observation), episodes),
        SCRIPTED: (ScriptedReach(env.unwrapped, speed), episodes),
        RESTING: (lambda *_: np.zeros(3), max(1, episodes // 10)),  # they last longest and differ least
    }
    try:
        return {
            name: [played(env, act, seed) for seed in tqdm(range(first, first + count), name, disable=None)]
            for name, (act, count) in acts.items()
        }
    finally:
        env.close()


def better_by(policy: Sequence[EpisodeResult], scripted: Sequence[EpisodeResult]) -> tuple[float, float]:
    """Return mean and half width of the 95 % interval (Student's t) of the difference of scores in equal episodes."""
    differences = [a.score - b.score for a, b in zip(policy, scripted, strict=True)]
    half = float(stdtrit(len(differences) - 1, 0.5 + 0.5 * LEVEL)) * float(np.std(differences, ddof=1))
    return float(np.mean(differences)), half / len(differences) ** 0.5


def table(results: dict[str, list[EpisodeResult]]) -> str:
    """Return the table of results for the terminal."""
    columns = "".join(f"{name:>9}" for name in ("episodes", "score", "reached", "time", "force"))
    lines = [f"{'':10}{columns}{'separation':>12}   episodes above a limit"]
    for name, episodes in results.items():
        reached = [episode.seconds for episode in episodes if episode.success]
        above = {limit: [limit in episode.violations for episode in episodes] for limit in (FORCE, REFLEX, SEPARATION)}
        above["force or reflex"] = [episode.violated for episode in episodes]
        counts = [f"{limit} {_counted(flags)}" for limit, flags in above.items()]
        lines.append(
            f"{name:10}{len(episodes):9}{np.mean([episode.score for episode in episodes]):9.2f}{len(reached):9}"
            f"{np.mean(reached) if reached else math.nan:9.2f}{max(episode.force for episode in episodes):9.2f}"
            f"{np.mean([episode.separation for episode in episodes]):12.2f}   {', '.join(counts)}"
        )
    for name, episodes in results.items():
        reflexes = Counter(episode.reflex for episode in episodes if episode.reflex)
        lines.append(f"reflexes of {name}: " + (", ".join(f"{x} {count}" for x, count in reflexes.items()) or "none"))
    mean, half = better_by(results[POLICY], results[SCRIPTED])
    lines.append(f"score of the policy less that of the scripted reach: {mean:.2f} +- {half:.2f} (95 %)")
    return "\n".join(lines)


def _counted(flags: Sequence[bool]) -> str:
    """Return the number of true flags with the exact interval of their share."""
    low, high = (100.0 * end for end in clopper_pearson(sum(flags), len(flags)))
    return f"{sum(flags)} ({low:.1f} to {high:.1f} %)"


def passed(results: dict[str, list[EpisodeResult]]) -> bool:
    """Return True if the policy beats the scripted reach and force or reflex exceed a limit in at most LARGEST."""
    episodes = results[POLICY]
    above = sum(episode.violated for episode in episodes)
    mean, half = better_by(episodes, results[SCRIPTED])
    return mean - half > 0.0 and above <= LARGEST * len(episodes)
