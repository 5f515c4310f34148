"""Evaluation of a policy on the task it was trained for, next to a scripted straight reach in the same episodes."""

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
from hric_gym.tasks import FORCE, SEPARATION, STOPPING
from hric_sweep.statistics.intervals import LEVEL, clopper_pearson

FIRST = 1_000_000
"""Seed of the first episode, without --first; a training starts from a smaller seed, so its episodes differ."""
PEAK = 1.875
"""Ratio of largest to mean speed in a minimum-jerk motion [1]."""
LARGEST = 0.01
"""Largest share of episodes with an exceeded force limit or a reflex, in a policy that passes [1] (project default)."""
REFLEX = "reflex"
POLICY, SCRIPTED, RESTING = "policy", "scripted", "resting"
"""Names of the rows of the table: the arm moved by the policy, by ScriptedReach, or not at all."""
CostLimit = Sequence[Any]
"""Name of a cost, and largest share of episodes in which it may exceed its limit [1]: `cost_limit` of a training."""
Act = Callable[[Any, dict[str, Any]], Any]
"""Function (scaled observation, `PolicyEnv.fields` and `first`: True in the first step) -> action, shape (3,)."""


@dataclass(frozen=True)
class EpisodeResult:
    """Result of one episode.

    Attributes:
        score: sum of the rewards of all steps [1].
        success: True if the end effector reached the goal.
        seconds: robot time until the end [s].
        violations: names of the costs that exceeded their limits or are not known, and REFLEX if the control box
            stopped the arm.
        force: largest contact force as share of its limit [1].
        separation: mean ratio of protective separation distance to distance, counted up to 10 [1].
        reflex: names of the errors with which the control box ended the episode; "": none.
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
    """Scripted straight motion of the end effector to the goal, with minimum jerk (Flash and Hogan, 1985).

    Args:
        env: environment in which the arm moves, with the actions of EndEffectorStream.
        speed: largest speed of the end effector [m/s].
    """

    def __init__(self, env: CollaborationEnv, speed: float) -> None:
        hw = env.simulation.app.hw
        assert isinstance(hw, FrankaHWSim), "the environment has refused other robots"
        self._model, self._speed, self._period = hw.model, speed, env.period

    def __call__(self, _: Any, fields: dict[str, Any]) -> FloatArray:
        """Return the action of a step, shape (3,).

        Args:
            fields: observation of the environment, and `first`: True in the first step, which starts the motion.
        """
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
    """Run an episode and return its result.

    Args:
        env: environment, from `policy_env.environment`.
        act: function that chooses the actions.
        seed: seed of the episode.
    """
    plain, score, seconds = env.unwrapped, 0.0, 0.0
    observation, info = env.reset(seed=seed)
    violations: set[str] = set()
    forces, separations, ended, first = [0.0], [], False, True
    while not ended:
        observation, reward, over, late, info = env.step(act(observation, {**env.fields, "first": first}))
        score, seconds, ended, first = score + reward, seconds + plain.period, over or late, False
        violations |= {*info["violations"], *info["not_known"]} | ({REFLEX} if info["reflex"] else set())
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
    """Run the episodes with the policy, the scripted reach and the arm at rest; return the results by these names.

    The arm at rest is run in the first tenth of the episodes only.

    Args:
        network: the policy.
        episodes: number of episodes.
        first: seed of the first episode; the following episodes have the following seeds.
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
    """Return the mean of the policy's score minus the scripted one in the same episodes, and half its 95 % interval."""
    values = [a.score - b.score for a, b in zip(policy, scripted, strict=True)]
    half = float(stdtrit(len(values) - 1, 0.5 + 0.5 * LEVEL)) * float(np.std(values, ddof=1))
    return float(np.mean(values)), half / len(values) ** 0.5


def table(results: dict[str, list[EpisodeResult]], limit: CostLimit | None = None) -> str:
    """Return the text table of the results of `evaluated`; `limit`: cost limit of the policy's training."""
    limits = dict.fromkeys((FORCE, REFLEX, STOPPING, SEPARATION, *(limit or ())[:1]))
    columns = "".join(f"{name:>9}" for name in ("episodes", "score", "reached", "time", "force"))
    lines = [f"{'':10}{columns}{'separation':>12}   episodes above a limit"]
    for name, episodes in results.items():
        reached = [episode.seconds for episode in episodes if episode.success]
        above = {limit: [limit in episode.violations for episode in episodes] for limit in limits}
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
    lines.append(f"score of the policy minus score of the scripted reach: {mean:.2f} +- {half:.2f} (95 %)")
    if limit is not None:
        shown = "kept" if _kept(results[POLICY], limit) else "not shown to be kept"
        lines.append(f"{limit[0]} above its limit in at most {100.0 * limit[1]:g} % of the episodes: {shown}")
    return "\n".join(lines)


def _counted(flags: Sequence[bool]) -> str:
    """Return the number of true flags, with the exact 95 % interval of their share [%], as text."""
    low, high = (100.0 * end for end in clopper_pearson(sum(flags), len(flags)))
    return f"{sum(flags)} ({low:.1f} to {high:.1f} %)"


def _kept(episodes: Sequence[EpisodeResult], limit: CostLimit) -> bool:
    """Return True if the exact 95 % interval of the share of episodes above the limit ends at the permitted share."""
    above = sum(limit[0] in episode.violations for episode in episodes)
    return bool(clopper_pearson(above, len(episodes))[1] <= limit[1])


def passed(results: dict[str, list[EpisodeResult]], limit: CostLimit | None = None) -> bool:
    """Return True if the policy is good and exceeds a force limit, or causes a reflex, in few episodes (LARGEST).

    Good: the 95 % interval of the difference to the scripted reach is above 0; or, for a policy with a cost limit, the
    interval of the share of episodes in which the cost exceeds its limit does not exceed the permitted share.
    """
    episodes = results[POLICY]
    above = sum(episode.violated for episode in episodes)
    mean, half = better_by(episodes, results[SCRIPTED])
    good = mean - half > 0.0 if limit is None else _kept(episodes, limit)
    return good and above <= LARGEST * len(episodes)
