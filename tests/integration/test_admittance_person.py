"""A simulated person leads the arm through the admittance controller: the port of the arm is passive.

The energy is computed from the recorded state of the arm, not from the controller: estimated external wrench less its
mean over the tare, times the measured twist of the end effector.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from hric_run.simulation import Simulation

EXPERIMENT = Path(__file__).parents[2] / "src/hric_experiments/config/experiments/hand_guidance.yaml"
SUBJECTS = ("P05_female", "P50_male", "P95_male")
DELAYS = (0.05, 0.1, 0.15)
"""Delays of the person's reflexes [s]."""
QUICK = ("P50_male", 0.1)
"""Case of the default tests; the others take a quarter of a minute each."""
MASS, INERTIA, TARE = 8.0, 0.3, slice(100, 200)
"""Virtual mass [kg] and inertia [kg m^2] of the default parameters, and cycles whose mean is the tare."""
WAY = [(0.42, 0.15, 0.55), (0.5, 0.1, 0.5), (0.42, -0.1, 0.6), (0.42, 0.0, 0.55)]
"""Points to which the person leads the arm in turn, position of the hand in the world [m]."""


def experiment(folder: Path, subject: str, delay: float, seconds: float) -> Path:
    """Write an experiment in which the person leads the arm by admittance; return its path."""
    raw: dict[str, Any] = yaml.safe_load(EXPERIMENT.read_text())
    raw["controllers"][-1] = "admittance_controller"
    raw["parameters"] = {"franka_state_controller": {"publish_rate": 1000.0}}
    raw["duration"], raw["human"]["subject"] = seconds, subject
    control = raw["human"]["control"]
    control["senses"] = {"joint_delay": delay}
    times = np.arange(0.5, seconds, 2.0)
    points = [WAY[(k - 1) % len(WAY)] for k in range(len(times))]
    control["parameters"]["reference"]["points"] = [
        [float(time), *point] for time, point in zip(times, points, strict=True)
    ]
    path = folder / "led.yaml"
    path.write_text(yaml.safe_dump(raw))
    return path


def recorded(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Run an experiment; return external wrench on the arm (n, 6) and pose of the end effector (n, 4, 4) per cycle."""
    rows: list[tuple[list[float], list[float]]] = []
    with Simulation(str(path)) as simulation:

        def note(topic: str, message: Any, _: float) -> None:
            if topic.endswith("franka_states"):
                rows.append((message.O_F_ext_hat_K, message.O_T_EE))

        simulation.node.tap(note)
        simulation.run()
        assert simulation.app.hw.error == ""
    wrench, columns = (np.array(values) for values in zip(*rows, strict=True))
    # The estimate is the wrench that the arm exerts.
    return wrench[TARE].mean(0) - wrench, columns.reshape(-1, 4, 4).transpose(0, 2, 1)


CASES = [
    pytest.param(subject, delay, 60.0, marks=[] if (subject, delay) == QUICK else [pytest.mark.slow])
    for subject in SUBJECTS
    for delay in DELAYS
]


@pytest.mark.parametrize(("subject", "delay", "seconds"), CASES)
def test_the_arm_never_returns_more_energy_than_the_person_gave(
    subject: str, delay: float, seconds: float, tmp_path: Path, figure: Callable[[str, float, str], None]
) -> None:
    wrench, T = recorded(experiment(tmp_path, subject, delay, seconds))
    R, p = T[:, :3, :3], T[:, :3, 3]
    turn = (Rotation.from_matrix(R[1:]) * Rotation.from_matrix(R[:-1]).inv()).as_rotvec()
    twist = np.hstack([np.diff(p, axis=0), turn]) * 1e3
    given = np.cumsum((0.5 * (wrench[1:] + wrench[:-1]) * twist).sum(1)) * 1e-3
    stored = 0.5 * MASS * (twist[:, :3] ** 2).sum(1) + 0.5 * INERTIA * (twist[:, 3:] ** 2).sum(1)
    lowest = float((given - stored).min())
    figure(f"admittance, {subject}, reflexes of {1e3 * delay:g} ms, {seconds:g} s: energy given", float(given[-1]), "J")
    figure(f"admittance, {subject}, reflexes of {1e3 * delay:g} ms: lowest energy less stored", lowest, "J")
    assert len(wrench) >= round(seconds * 1e3) - 1
    assert lowest >= -1e-6
    assert given[-1] > 1.0 and math.dist(p.min(0), p.max(0)) > 0.1
