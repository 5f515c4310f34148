"""Commands `hric train` and `hric check_policy`: train a policy, and evaluate it on its task."""

import argparse
import time
from pathlib import Path
from typing import Any

from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD, HricError, check_known
from hric_core.parameters import number, whole
from hric_core.processes import INTERRUPTED_CODE

STEPS = 14_000
"""Number of actions in a training, without --steps (project default)."""
EPISODES = 200
"""Number of episodes of an evaluation, without --episodes (project default)."""


class TrainCommand(Command):
    """Train a policy that moves the end effector to goals, and write it for hric_controllers/PolicyController.

    The policy chooses the speed on the straight line to the goal. SAC of stable-baselines3 trains it in the environment
    of the task, with the person. Ctrl-C ends the training and writes the policy so far, with a checkpoint from which
    --resume continues; both are also written every 1000 actions. The same seed gives the same file.
    """

    def arguments(self) -> list[Argument]:
        """Return the task and the options of `hric train`."""
        return [
            Argument("task", metavar="TASK", help="task of hric_gym whose goal is a point: Reach"),
            Argument(
                "--output", type=Path, default=Path("policy.onnx"), metavar="FILE", help="policy (default: policy.onnx)"
            ),
            Argument("--steps", type=int, help=f"actions in the training (default: {STEPS})"),
            Argument("--seed", type=int, help="seed of all random numbers (default: 0)"),
            Argument(
                "--weight",
                nargs=2,
                action="append",
                default=[],
                metavar=("COST", "WEIGHT"),
                help="weight of a cost in the reward instead of its default, e.g. separation 0.01; may be repeated",
            ),
            Argument(
                "--cost-limit",
                nargs=2,
                metavar=("COST", "SHARE"),
                help="largest share of the episodes, 0 to 1, in which a cost may exceed its limit, e.g. stopping 0.3; "
                "the training finds the weight of the cost (default: no limit)",
            ),
            Argument(
                "--resume", action="store_true", help="continue from the checkpoint, with its steps, seed and weights"
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Train the policy, and write it and its checkpoint."""
        from hric_controllers.policy.network import PolicyNetwork
        from hric_gym.environment import WEIGHTS
        from hric_gym.evaluation import FIRST
        from hric_gym.policy_env import contract
        from hric_gym.tasks import COSTS
        from hric_gym.training import train

        output = arguments.output
        given = {
            name for name in ("steps", "seed", "weight", "cost_limit") if getattr(arguments, name) not in (None, [])
        }
        if arguments.resume and given:
            option = f"--{min(given).replace('_', '-')}"
            raise HricError(f"--resume takes {option} from the checkpoint; valid: --resume without {option}")
        steps = whole(minimum=1000).checked(STEPS if arguments.steps is None else arguments.steps, "--steps")
        if output.suffix != ".onnx" or not output.parent.is_dir():
            raise HricError(f"--output is {output}; valid: a file with the suffix .onnx in a folder that exists")
        checkpoint = [output, *(output.with_suffix(suffix) for suffix in (".zip", ".replay"))]
        if not arguments.resume and (existing := next(filter(Path.exists, checkpoint), None)):
            raise HricError(f"{existing} exists; valid: another name with --output, or --resume")
        weights = {name: _given(text, number(minimum=0.0), "--weight") for name, text in arguments.weight}
        settings = {"steps": steps, "seed": whole(minimum=0, maximum=FIRST - 1).checked(arguments.seed or 0, "--seed")}
        settings["weights"] = WEIGHTS | weights
        if arguments.cost_limit is not None:
            name, share = arguments.cost_limit
            check_known("cost", [name], COSTS)
            settings["cost_limit"] = [name, _given(share, number(minimum=0.0, maximum=1.0), "--cost-limit")]
        agreed = PolicyNetwork(output).contract if arguments.resume else contract(arguments.task, settings)
        if (trained := agreed.training.get("task")) != arguments.task:
            valid = trained or "a file by hric train"
            raise HricError(f"{output} is no policy of the task {arguments.task}; valid with --resume: {valid}")
        before = time.process_time()
        completed = train(agreed, output, resume=arguments.resume)
        print(f"processor time: {(time.process_time() - before) / 60.0:.1f} min")
        print(f"{output} written" if completed else f"interrupted; {output} has the policy so far; --resume continues")
        return 0 if completed else INTERRUPTED_CODE


def _given(text: str, quantity: Any, option: str) -> float:
    """Return the number of an option. Raises ParameterError if it is not a valid one of the quantity."""
    try:
        value: object = float(text)
    except ValueError:
        value = text
    return float(quantity.checked(value, option))


class CheckPolicyCommand(Command):
    """Evaluate a policy on the task it was trained for, next to a scripted straight reach and an arm at rest.

    All three run in the same episodes, which the training has not used. The table has mean score, number of episodes
    that reached the goal and their mean time [s], largest force as share of its contact limit [1], mean ratio of
    protective separation distance to distance [1] (counted up to 10), and the number of episodes above each limit, with
    the exact 95 % interval.
    """

    epilog = (
        "exit codes: 0 the policy scores better than the scripted reach or, if it was trained with a cost limit, keeps "
        "that, and force or reflex exceed a limit in at most 1 % of the episodes; 3 it does not."
    )

    def arguments(self) -> list[Argument]:
        """Return the policy file and the options of `hric check_policy`."""
        return [
            Argument("policy", type=Path, metavar="FILE", help="ONNX file of hric train"),
            Argument("--episodes", type=int, default=EPISODES, help=f"number of episodes (default: {EPISODES})"),
            Argument("--first", type=int, default=None, help="seed of the first episode (default: 1000000)"),
            Argument(
                "--speed", type=float, default=None, help="largest speed of the scripted reach [m/s] (default: 0.7)"
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Evaluate the policy and print the table."""
        from hric_controllers.policy.network import PolicyNetwork
        from hric_gym import actions, evaluation

        episodes = whole(minimum=2).checked(arguments.episodes, "--episodes")
        usual = number(actions.STREAM_SPEED, above=0.0, unit="m/s")
        speed = usual.checked(usual if arguments.speed is None else arguments.speed, "--speed")
        first = whole(evaluation.FIRST, minimum=0)
        start = first.checked(first if arguments.first is None else arguments.first, "--first")
        network = PolicyNetwork(arguments.policy)
        limit: Any = network.contract.training.get("cost_limit")
        results = evaluation.evaluated(network, episodes, start, speed)
        print(f"{episodes} episodes, seeds {start} to {start + episodes - 1}")
        print(evaluation.table(results, limit))
        return 0 if evaluation.passed(results, limit) else NOT_GOOD
