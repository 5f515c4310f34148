"""Training of a policy by SAC of stable-baselines3, and its export to ONNX with its contract."""

import math
import signal
import threading
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from hric_bags import files
from hric_controllers.policy.contract import KEY, PolicyContract, Vector
from hric_controllers.policy.network import ACTIONS, INPUT, OUTPUT
from hric_core.errors import HricError
from hric_gym.policy_env import PolicyEnv, environment, force_excess
from hric_gym.spaces import Wrapper, unit_box
from hric_gym.tasks import FORCE

try:
    import onnx
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.buffers import ReplayBuffer
    from stable_baselines3.common.callbacks import BaseCallback
except ImportError:
    raise HricError(
        "training needs PyTorch and stable-baselines3, which scripts/setup --with learning installs on Debian 12"
    ) from None

SETTINGS: Mapping[str, Any] = {
    "gamma": 0.95,
    "batch_size": 256,
    "learning_starts": 1000,
    "gradient_steps": 2,
    "ent_coef": "auto_0.02",
    "policy_kwargs": {"net_arch": [64, 64]},
}
"""Parameters of stable-baselines3's SAC that differ from its defaults (project default)."""
RATE = 1e-3
"""Learning rate at the start of a training [1]; it decreases linearly to zero (project default)."""
SLOWEST = 0.2
"""Smallest speed that the network can choose, as share of the full speed [1] (project default). At this speed the arm
reaches every goal within the time of the task, so even an untrained network does."""
CAREFUL = 0.05
"""SLOWEST of a training with a cost limit [1] (project default): near the person the arm has to be slower."""
FORCE_COST = 20.0
"""Weight with which `policy_env.force_excess` reduces the reward of a training step [1] (project default). Reflexes
alone are too rare to show how near a motion came to one."""
ASCENT = 0.05
"""Change of the weight of the limited cost per episode above the limit and episode aimed at [1] (project default)."""
AIM = 0.6
"""Ratio of the share of episodes at which a training aims to the largest permitted share [1] (project default). A
policy at the permitted share itself would exceed it in half of all checks."""
LIMITED = "limited"
"""Key of `info` in training: limited cost of the step beyond WEIGHED, as share of its limit, at most 1 [1]."""
WEIGHED = 0.5
"""Share of its limit above which a limited cost reduces the reward [1] (project default). The training thus also learns
from steps that come near the limit."""
TINY = 1e-6
"""Smallest divisor of the goal's offset, which prevents a division by zero [1]."""
SAVING = 1000
"""Number of steps between two checkpoints, so that a killed training can be resumed."""
RECENT = 50
"""Number of episodes over which the progress bar averages."""
STOP_SIGNALS = signal.SIGINT, signal.SIGTERM
"""Signals after which a training writes its policy and ends."""
Ends = list[tuple[float, bool, bool]]


class _Progress(BaseCallback):
    """Progress bar with mean return, and shares of episodes with success and with a violation; it ends at a signal.

    The figures are those of the newest RECENT episodes. A violation is a force above its limit, or a reflex.
    """

    def __init__(self, done: int, steps: int, interrupted: threading.Event) -> None:
        super().__init__()
        self._bar, self._interrupted = tqdm(initial=done, total=steps, unit=" steps", desc="SAC"), interrupted
        self._ends, self._score, self._violated = Ends(), 0.0, False

    def _on_step(self) -> bool:
        info = self.locals["infos"][0]
        self._score += float(self.locals["rewards"][0])
        self._violated |= bool(FORCE in info["violations"] or info["reflex"])
        if self.locals["dones"][0]:
            self._ends = [*self._ends, (self._score, info["success"], self._violated)][-RECENT:]
            score, success, violated = np.mean(self._ends, axis=0)
            self._bar.set_postfix_str(f"return {score:.2f}, success {success:.2f}, violations {violated:.2f}")
            self._score, self._violated = 0.0, False
        self._bar.update(1)
        return not self._interrupted.is_set()

    def _on_training_end(self) -> None:
        self._bar.close()


class _Checkpoints(BaseCallback):
    """Writer of a checkpoint after every SAVING steps; `save` writes it."""

    def __init__(self, save: Callable[[], None]) -> None:
        super().__init__()
        self._save = save

    def _on_rollout_start(self) -> None:  # between two steps: the last one is stored
        if self.num_timesteps and self.num_timesteps % SAVING == 0:
            self._save()

    def _on_step(self) -> bool:
        return True


class CostBuffer(ReplayBuffer):
    """Replay buffer that reduces the reward of each step by its limited cost, times a weight.

    Attributes:
        weight: Lagrange multiplier of the constraint [1]; a change applies to all steps in the buffer.
    """

    def __init__(self, buffer_size: int, *arguments: Any, **options: Any) -> None:
        super().__init__(buffer_size, *arguments, **options)
        self.weight, self._costs = 0.0, np.zeros((buffer_size, 1), np.float32)

    def add(self, obs: Any, next_obs: Any, action: Any, reward: Any, done: Any, infos: list[dict[str, Any]]) -> None:
        """Store a step; its cost is in `infos`."""
        self._costs[self.pos] = infos[0][LIMITED]
        super().add(obs, next_obs, action, reward, done, infos)

    def _get_samples(self, batch_inds: Any, env: Any = None) -> Any:
        samples = super()._get_samples(batch_inds, env)
        return samples._replace(rewards=samples.rewards - self.weight * self.to_torch(self._costs[batch_inds]))


class _CostLimit(BaseCallback):
    """Dual ascent: the weight grows after an episode in which the cost exceeded its limit, and else decreases.

    A cost that is not known counts as exceeding its limit.

    Args:
        cost: name of the cost.
        aim: share of the episodes in which the cost may exceed its limit [1].
    """

    def __init__(self, cost: str, aim: float) -> None:
        super().__init__()
        self._cost, self._aim, self._above = cost, aim, False

    def _on_step(self) -> bool:
        info = self.locals["infos"][0]
        self._above |= self._cost in {*info["violations"], *info["not_known"]}
        if self.locals["dones"][0]:
            buffer = self.locals["replay_buffer"]
            buffer.weight = max(0.0, buffer.weight + ASCENT * (self._above - self._aim))
            self._above = False
        return True


def _limit(agreed: PolicyContract) -> Any:
    """Return the cost limit of a training, [name of the cost, largest share of episodes]; None: there is none."""
    return agreed.training.get("cost_limit")


def slowest(agreed: PolicyContract) -> float:
    """Return the smallest speed that a network with this contract can choose, as share of the full speed [1]."""
    return CAREFUL if _limit(agreed) else SLOWEST


class TrainingEnv(Wrapper):
    """Environment whose action is the speed of the straight motion to the goal; hard contacts reduce the reward.

    An action of 1 is full speed along the axis on which the goal is farthest, -1 is `slowest` times that. The network
    that `export` writes moves in the same way.

    Args:
        env: environment of the policy.
        agreed: contract of the policy.
    """

    def __init__(self, env: PolicyEnv, agreed: PolicyContract) -> None:
        super().__init__(env)
        self.action_space, self._slowest = unit_box(1), slowest(agreed)
        self._limited, *_ = _limit(agreed) or [""]

    def reset(self, **settings: Any) -> tuple[Vector, dict[str, Any]]:
        """Begin an episode; return observation and `info`, see `CollaborationEnv.reset`."""
        self._observation, info = self.env.reset(**settings)
        return self._observation, info

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Move straight to the goal for one step; `action`: speed as a number from -1 to 1, shape (1,)."""
        offset = self._observation[-3:]
        speed = self._slowest + (1.0 - self._slowest) * 0.5 * (float(action[0]) + 1.0)
        velocity = speed * offset / max(float(np.abs(offset).max()), TINY)
        self._observation, reward, ended, late, info = self.env.step(velocity)
        reward -= FORCE_COST * force_excess(info["costs"])
        limited = float(np.clip(info["costs"].get(self._limited, math.inf) - WEIGHED, 0.0, 1.0))
        return self._observation, float(reward), ended, late, {**info, LIMITED: limited}


def train(agreed: PolicyContract, output: Path, *, resume: bool = False) -> bool:
    """Train a policy, and write it and a checkpoint; return True if all steps were done, False after Ctrl-C or SIGTERM.

    Both are also written after every SAVING steps.

    Args:
        agreed: contract of the policy; its `training` has the task, `steps`, `seed`, `weights` of the reward and, if
            the training is constrained, `cost_limit`: name of a cost, and largest share of episodes in which it may
            exceed its limit.
        output: ONNX file; the checkpoint is next to it, with the suffixes .zip and .replay.
        resume: True: continue from the checkpoint; False: start a new training.

    Raises:
        HricError: there is no checkpoint, or the environment refuses the settings.
    """
    torch.set_num_threads(1)  # fastest for networks of this size
    steps, seed = (int(str(agreed.training[name])) for name in ("steps", "seed"))
    checkpoint, replay = output.with_suffix(".zip"), output.with_suffix(".replay")
    if resume and not (checkpoint.is_file() and replay.is_file()):
        raise HricError(
            f"--resume needs the checkpoint {checkpoint} and {replay}, of which one is missing; "
            "valid: --output of an earlier training, or no --resume"
        )
    limit, env = _limit(agreed), TrainingEnv(environment(agreed), agreed)
    rate = {"learning_rate": lambda left: RATE * left}
    if resume:
        model = SAC.load(checkpoint, env, custom_objects=rate)
        model.load_replay_buffer(replay)
    else:
        buffer = CostBuffer if limit else None
        model = SAC("MlpPolicy", env, seed=seed, buffer_size=steps, replay_buffer_class=buffer, **rate, **SETTINGS)
    save = partial(_save_all, model, agreed, output)
    interrupted, done = threading.Event(), model.num_timesteps
    previous = {number: signal.signal(number, lambda *_: interrupted.set()) for number in STOP_SIGNALS}
    callbacks: list[BaseCallback] = [_Progress(done, steps, interrupted), _Checkpoints(save)]
    callbacks += [_CostLimit(limit[0], AIM * limit[1])] if limit else []
    try:
        model.learn(steps - done, callbacks, reset_num_timesteps=False)
        save()
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
        env.close()
    return not interrupted.is_set()


def _save_all(model: Any, agreed: PolicyContract, output: Path) -> None:
    """Write the policy and its checkpoint, each file as a whole."""
    writers: dict[Path, Callable[[Path], object]] = {
        output.with_suffix(".zip"): model.save,
        output.with_suffix(".replay"): model.save_replay_buffer,
        output: partial(export, model, agreed),
    }
    for path, write in writers.items():
        with files.atomic(path) as temporary:
            write(temporary)


def export(model: Any, agreed: PolicyContract, output: Path) -> None:
    """Write the deterministic policy as an ONNX file with the contract: straight motion at the speed of SAC's mean.

    The network takes the direction from the offset of the goal, the last field of the observation.
    """
    actor, make = model.actor, onnx.helper.make_node
    layers = [layer for layer in (*actor.latent_pi, actor.mu) if isinstance(layer, torch.nn.Linear)]
    half = 0.5 * (1.0 - slowest(agreed))
    constants = {"half": np.float32(half), "middle": np.float32(1.0 - half), "tiny": np.float32(TINY)} | {
        name: np.array([value]) for name, value in (("first", agreed.size - 3), ("end", agreed.size), ("axis", 1))
    }
    nodes, value = [], INPUT
    for index, layer in enumerate(layers):
        names = [f"weight{index}", f"bias{index}"]
        constants |= {
            name: array.detach().numpy() for name, array in zip(names, (layer.weight, layer.bias), strict=True)
        }
        nodes.append(make("Gemm", [value, *names], [f"sum{index}"], transB=1))
        value = f"layer{index}"
        nodes.append(make("Tanh" if layer is actor.mu else "Relu", [f"sum{index}"], [value]))
    nodes += [
        make("Slice", [INPUT, "first", "end", "axis"], ["offset"]),
        make("Abs", ["offset"], ["distances"]),
        make("ReduceMax", ["distances"], ["farthest"], axes=[1]),
        make("Max", ["farthest", "tiny"], ["length"]),
        make("Div", ["offset", "length"], ["straight"]),
        make("Mul", [value, "half"], ["more"]),
        make("Add", ["more", "middle"], ["speed"]),
        make("Mul", ["straight", "speed"], [OUTPUT]),
    ]
    _save(nodes, constants, agreed, output)


def _save(nodes: list[Any], constants: Mapping[str, Any], agreed: PolicyContract, output: Path) -> None:
    """Write an ONNX file with the nodes of a network, its constants by name, and the contract."""
    ends = [
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, count])
        for name, count in ((INPUT, agreed.size), (OUTPUT, ACTIONS))
    ]
    weights = [onnx.numpy_helper.from_array(np.asarray(array), name) for name, array in constants.items()]
    graph = onnx.helper.make_graph(nodes, "policy", ends[:1], ends[1:], weights)
    made = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    onnx.helper.set_model_props(made, {KEY: agreed.text()})
    onnx.save(made, str(output))
