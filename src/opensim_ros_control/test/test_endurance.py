"""Long runs, many models, and the end of a process: each in a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

HELPER = Path(__file__).parent / "endurance.py"
LEAST_GROWTH = 2.0
"""Rise of the resident memory that counts as growth [MiB]: pages of the allocator, a tenth of what one plant takes."""
REDUCED = {"rotor_inertia": 0.0}
FULL = {"rotor_inertia": 0.1, "integrator": "semi_implicit"}


def memory(what, config, amount):
    """Resident memory at ten moments [MiB]; the process must end by itself and without a crash."""
    done = subprocess.run(
        [sys.executable, str(HELPER), what, json.dumps(config), str(amount)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return [float(line) for line in done.stdout.split() if line[0].isdigit()]


@pytest.mark.parametrize("config", [REDUCED, FULL], ids=["manager", "rotors"])
def test_a_process_with_several_plants_ends_without_a_crash(config):
    assert len(memory("exit", config, 3)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("config", [REDUCED, FULL], ids=["manager", "rotors"])
def test_memory_does_not_grow_over_ten_simulated_minutes(config):
    seen = memory("motion", config, 600_000)
    print(seen)
    assert len(seen) == 10
    assert seen[-1] - seen[1] < LEAST_GROWTH


@pytest.mark.slow
def test_memory_does_not_grow_over_a_thousand_models(tmp_path):
    seen = memory("builds", REDUCED, 1000)
    print(seen)
    assert len(seen) == 10
    assert seen[-1] - seen[1] < LEAST_GROWTH
