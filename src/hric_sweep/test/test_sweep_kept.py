"""Signals that a sweep stores for its worst and its failed runs, and their contents."""

from pathlib import Path

import bad_controller
import numpy as np
import pytest
import test_sweep as sweeps
from in_process import Here, carried_out

from hric_sweep import definition

RUNS, WORST = 5, 2


def test_the_worst_runs_are_kept_with_the_signals_that_gave_their_numbers_also_after_ctrl_c(tmp_path: Path) -> None:
    given = {"runs": RUNS, "objective": {"maximise": "speed"}, "keep": {"worst": WORST}}
    plan = definition.load(str(sweeps.written(tmp_path, **given)))
    with pytest.raises(KeyboardInterrupt):
        carried_out(tmp_path, plan, Here(after=RUNS + 1))  # while the second of the worst is made again
    (first,) = (tmp_path / "columns").iterdir()
    untouched = first.stat().st_mtime_ns
    engine = Here()
    rows = carried_out(tmp_path, plan, engine)
    assert engine.begun == 1 and first.stat().st_mtime_ns == untouched
    worst = sorted(rows, key=lambda row: -row.outputs["speed"])[:WORST]
    assert {path.name for path in (tmp_path / "columns").iterdir()} == {f"{row.id}.npz" for row in worst}
    for row in worst:
        kept = np.load(tmp_path / "columns" / f"{row.id}.npz")
        cycles, joints = kept["position"].shape
        assert (cycles, joints) == (300, 7) and kept["joint_names"].tolist()[0] == "panda_joint1"
        assert kept["time"] == pytest.approx(kept["time"][0] + 1e-3 * np.arange(cycles))
        assert np.abs(kept["velocity"]).max() == pytest.approx(row.outputs["speed"], rel=1e-6)
        moved = np.diff(kept["position"], axis=0) / 1e-3
        assert np.allclose(moved, kept["velocity"][1:], atol=2e-2) and np.isfinite(kept["command"]).all()


def test_a_run_that_failed_is_kept_up_to_where_it_failed_unless_it_is_not_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = bad_controller.sweep(tmp_path, monkeypatch, ["raises late", "not"])
    plan = definition.load(str(path))
    rows = carried_out(tmp_path, plan, Here())
    assert "ValueError" in rows[0].failure and rows[1].failure == ""
    kept = np.load(tmp_path / "columns" / f"{rows[0].id}.npz")
    assert kept["time"][-1] > bad_controller.LATE
    (tmp_path / "others").mkdir()
    path.write_text(path.read_text().replace("sweep:\n", "sweep:\n  keep: {failed: false, worst: 0}\n"))
    carried_out(tmp_path / "others", definition.load(str(path)), Here())
    assert not (tmp_path / "others" / "columns").exists()
