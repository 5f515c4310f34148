"""Limits of the processor time of `export`, as ratios to reading the raw messages of the same bag."""

from pathlib import Path

import pytest
from export_cost import measure

from hric_bags.export import recording
from hric_report import headless
from hric_run.definition import experiment

pytestmark = pytest.mark.alone

BOUNDS = {
    "npz": 16.0,
    "csv": 24.0,
    "parquet": 20.0,
    "mot": 6.0,
    "sto": 12.0,
    "bag": 10.0,
    "mcap": 12.0,
    "ros2": 12.0,
    "lerobot": 12.0,
}
"""Largest ratios, two to three times the measured ones; the mix of topics matters more than the machine."""


@pytest.mark.slow
def test_exporting_costs_a_small_multiple_of_reading_the_bag(tmp_path: Path) -> None:
    folder = headless.run(
        experiment.load("pd_step", ("duration:=4.0",)), (), root=tmp_path, progress=False, figures=False
    ).folder
    raw, ratios, _ = measure(recording.find(str(folder.path)), tuple(BOUNDS))
    print(f"raw {raw:.3f} s; " + ", ".join(f"{kind} {ratio:.1f}" for kind, ratio in ratios.items()))
    assert all(ratios[kind] <= bound for kind, bound in BOUNDS.items()), ratios
