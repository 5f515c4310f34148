"""Processor time of learning environments per second of robot time, compared with panda-gym in the same run.

    python tests/benchmarks/panda_gym_cost.py /path/to/venv/bin/python

panda-gym is not part of this workspace: install it in an environment of its own (`python3 -m venv venv`,
`venv/bin/pip install panda-gym`). Its task PandaReach and ours have equal steps of 40 ms with random actions; PyBullet
simulates 2 ms per step there, MuJoCo and the emulated control box 1 ms here.
"""

import os
import statistics
import sys
import time
from contextlib import ExitStack
from pathlib import Path

OURS = ("environment/joints", "environment/cartesian", "environment/person", "environment/muscles")
TASKS = ("PandaReachJoints-v3", "PandaReach-v3")
STEPS = 50
"""Number of steps of panda-gym in a block."""
ROUNDS = 20


def serve(task: str) -> None:
    """Measure blocks of a task of panda-gym, with the protocol of worker.py; runs in panda-gym's interpreter."""
    import gymnasium
    import panda_gym  # noqa: F401  (registers its tasks)

    environment = gymnasium.make(task)
    environment.action_space.seed(0)
    environment.reset(seed=0)
    simulation = environment.unwrapped.sim
    period = simulation.timestep * simulation.n_substeps

    def block() -> float:
        spent = 0.0
        for _ in range(STEPS):
            action = environment.action_space.sample()
            begin = time.thread_time()
            *_, terminated, truncated, _ = environment.step(action)
            spent += time.thread_time() - begin
            if terminated or truncated:
                environment.reset()
        return 1e-3 * spent / (STEPS * period)

    block()
    print("ready", flush=True)
    for _ in sys.stdin:
        print("time", repr(block()), flush=True)


def compare(interpreter: str) -> list[str]:
    """Return lines of the measured times per second of robot time, and of their ratios to panda-gym's tasks."""
    from turns import Worker, take_turns  # panda-gym's interpreter has no package of this workspace

    bare = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME")}
    with ExitStack() as stack:
        workers = [
            stack.enter_context(Worker(task, command=[interpreter, str(Path(__file__)), "--serve", task], env=bare))
            for task in TASKS
        ]
        workers += [stack.enter_context(Worker(name)) for name in OURS]
        times = take_turns(workers, ROUNDS)
    lines = [f"{'':24}{'ms per s':>10}{TASKS[0]:>22}{TASKS[1]:>16}"]
    for name, row in zip((*TASKS, *OURS), times, strict=True):
        ratios = [statistics.median(a / b for a, b in zip(row, other, strict=True)) for other in times[: len(TASKS)]]
        lines.append(f"{name:24}{1e6 * statistics.median(row):10.1f}{ratios[0]:22.2f}{ratios[1]:16.2f}")
    return lines


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(sys.argv[2])
    elif len(sys.argv) == 2 and os.access(sys.argv[1], os.X_OK):
        print(*compare(sys.argv[1]), sep="\n")
    else:
        sys.exit(f"usage: {sys.argv[0]} INTERPRETER; valid: the Python of an environment with panda-gym")
