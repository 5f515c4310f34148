"""Training of a policy by SAC of stable-baselines3, and its export to ONNX with its contract."""

import signal
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from hric_controllers.policy.contract import KEY, PolicyContract
from hric_controllers.policy.network import INPUT, OUTPUT
from hric_core.errors import HricError
from hric_gym.policy_env import environment
from hric_gym.spaces import TransformReward
from hric_gym.tasks import FORCE

try:
    import onnx
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.utils import FloatSchedule
except ImportError:
    raise HricError(
        "training needs stable-baselines3, which is not installed:  scripts/setup --with learning"
    ) from None

SETTINGS: Mapping[str, Any] = {
    "gamma": 0.95,
    "batch_size": 256,
    "learning_starts": 1000,
    "ent_coef": "auto_0.05",
    "policy_kwargs": {"net_arch": [64, 64]},
}
"""Parameters of stable-baselines3's SAC that differ from its defaults (project default)."""
TIME_COST = 0.2
"""Amount by which training reduces the reward of each step [1] (project default). Without it, a policy learns to stay
near the goal instead of reaching it."""
PHASES = (("none", 0.36, 1e-3), ("scripted", 0.72, 1e-3), ("none", 1.0, 3e-4))
"""Phases of a training: kind of person, share of all steps at which the phase ends [1], learning rate [1] (project
default). The arm learns to move without a person, where a step takes half the computing time, then to avoid contacts,
then to stop at the goal."""
RECENT = 50
"""Number of episodes over which the progress bar averages."""
Ends = list[tuple[float, bool, bool]]


class _Progress(BaseCallback):
    """Progress bar with mean score, and shares of episodes with success and with a violation; it ends at Ctrl-C.

    The figures are those of the newest RECENT episodes. A violation is a force above its limit, or a reflex.
    """

    def __init__(self, steps: int, person: str, interrupted: threading.Event) -> None:
        super().__init__()
        self._bar, self._interrupted = tqdm(total=steps, unit=" steps", desc=f"person {person}"), interrupted
        self._ends, self._score, self._violated = Ends(), 0.0, False

    def _on_step(self) -> bool:
        info = self.locals["infos"][0]
        self._score += float(self.locals["rewards"][0]) + TIME_COST
        self._violated |= bool(FORCE in info["violations"] or info["reflex"])
        if self.locals["dones"][0]:
            self._ends = [*self._ends, (self._score, info["success"], self._violated)][-RECENT:]
            score, success, violated = np.mean(self._ends, axis=0)
            self._bar.set_postfix_str(f"score {score:.2f}, success {success:.2f}, violations {violated:.2f}")
            self._score, self._violated = 0.0, False
        self._bar.update(1)
        return not self._interrupted.is_set()

    def _on_training_end(self) -> None:
        self._bar.close()


def train(agreed: PolicyContract, output: Path, *, resume: bool = False) -> bool:
    """Train a policy, and write it and a checkpoint; return True if all steps were done, False after Ctrl-C.

    Args:
        agreed: contract of the policy; its `training` has the task, `steps`, `seed` and `weights` of the reward.
        output: ONNX file; the checkpoint is next to it, with the suffixes .zip and .replay.
        resume: True: continue from the checkpoint; False: start a new training.

    Raises:
        HricError: there is no checkpoint, or the environment refuses the settings.
    """
    torch.set_num_threads(1)  # fastest for networks of this size
    steps, seed = (int(str(agreed.training[name])) for name in ("steps", "seed"))
    checkpoint, replay = output.with_suffix(".zip"), output.with_suffix(".replay")
    env = _environment(agreed, "none")
    if resume:
        if not (checkpoint.is_file() and replay.is_file()):
            raise HricError(
                f"--resume needs the checkpoint {checkpoint} and {replay}, of which one is missing; "
                "valid: --output of an earlier training, or no --resume"
            )
        model = SAC.load(checkpoint, env)
        model.load_replay_buffer(replay)
    else:
        model = SAC("MlpPolicy", env, seed=seed, buffer_size=steps, **SETTINGS)
    interrupted = threading.Event()
    previous = signal.signal(signal.SIGINT, lambda *_: interrupted.set())
    try:
        for person, end, rate in PHASES:
            left = round(end * steps) - model.num_timesteps
            if left > 0 and not interrupted.is_set():
                env.close()
                env = _environment(agreed, person)
                model.set_env(env)
                model.lr_schedule = FloatSchedule(rate)
                model.learn(left, _Progress(left, person, interrupted), reset_num_timesteps=False)
    finally:
        signal.signal(signal.SIGINT, previous)
        env.close()
    model.save(checkpoint)
    model.save_replay_buffer(replay)
    export(model, agreed, output)
    return not interrupted.is_set()


def _environment(agreed: PolicyContract, person: str) -> Any:
    return TransformReward(environment(agreed, person), lambda reward: reward - TIME_COST)


def export(model: Any, agreed: PolicyContract, output: Path) -> None:
    """Write the deterministic policy of SAC, the tanh of its mean action, as an ONNX file with the contract.

    Args:
        model: trained SAC of stable-baselines3.
        agreed: contract of the policy.
        output: ONNX file.
    """
    actor = model.actor
    layers = [layer for layer in (*actor.latent_pi, actor.mu) if isinstance(layer, torch.nn.Linear)]
    nodes, weights, value = [], [], INPUT
    for index, layer in enumerate(layers):
        names = [f"weight{index}", f"bias{index}"]
        for name, array in zip(names, (layer.weight, layer.bias), strict=True):
            weights.append(onnx.numpy_helper.from_array(array.detach().numpy(), name))
        last = index == len(layers) - 1
        nodes.append(onnx.helper.make_node("Gemm", [value, *names], [f"sum{index}"], transB=1))
        value = OUTPUT if last else f"layer{index}"
        nodes.append(onnx.helper.make_node("Tanh" if last else "Relu", [f"sum{index}"], [value]))
    kind, size = onnx.TensorProto.FLOAT, layers[-1].out_features
    ends = [
        onnx.helper.make_tensor_value_info(name, kind, [1, count])
        for name, count in ((INPUT, agreed.size), (OUTPUT, size))
    ]
    graph = onnx.helper.make_graph(nodes, "policy", ends[:1], ends[1:], weights)
    made = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    onnx.helper.set_model_props(made, {KEY: agreed.text()})
    onnx.save(made, str(output))
