"""Distributions of other packages, and rows drawn by a function, both named only in the sweep file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_sweep as sweeps
from in_process import Here, carried_out

from hric_core.errors import HricError
from hric_sweep import definition

TOY = """\
from dataclasses import dataclass

from hric_core.parameters import number
from hric_sweep.variables import Distribution


@dataclass(frozen=True)
class Squared(Distribution):
    largest: float = number(text="value at the last percentile")

    def ppf(self, u):
        return (self.largest * u**2).tolist()


def gains(seed):
    return {"kp": 50.0 + seed}
"""


@pytest.fixture(autouse=True)
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "toy_sweeps.py").write_text(TOY)
    monkeypatch.syspath_prepend(tmp_path)


def kp(distribution: dict[str, Any]) -> dict[str, Any]:
    return {"kp": {"paths": ["parameters.joint_pd_controller.kp"], "distribution": distribution}}


def test_a_distribution_of_another_package_gives_the_values(tmp_path: Path) -> None:
    vary = kp({"kind": "toy_sweeps:Squared", "largest": 100.0})
    plan = definition.load(str(sweeps.written(tmp_path, vary=vary)))
    assert [row["kp"] for row in plan.space.values(np.array([[0.5], [0.9]]))] == pytest.approx([25.0, 81.0])


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ({"soft": ["kp:=50"], "stiff": {"kp": 60}}, {"soft": 50, "stiff": 60}),
        ("toy_sweeps:gains", {"3": 53.0, "4": 54.0}),
    ],
)
def test_rows_are_runs_one_by_one(rows: Any, expected: dict[str, float], tmp_path: Path) -> None:
    section = {"vary": {}, "rows": rows, "sampler": {"kind": "list"}, "runs": 2, "seed": 3, "keep": {"worst": 0}}
    plan = definition.load(str(sweeps.written(tmp_path, **section)))
    done = carried_out(tmp_path, plan, Here())
    assert {row.values[definition.ROW]: plan.changes(row.values)["kp"] for row in done} == expected
    assert [row.seed for row in done] == [3, 4] and done[0].state_sha256 != done[1].state_sha256


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"sampler": {"kind": "toy_sweeps:Nobody"}}, "kind is 'toy_sweeps:Nobody'; valid: MODULE:NAME"),
        ({"sampler": {"kind": "toy_sweeps:gains"}}, "toy_sweeps:gains is no valid kind"),
        ({"vary": {}, "rows": {"soft": "kp:=50"}, "sampler": {"kind": "list"}}, "rows.soft is 'kp:=50'; valid"),
        ({"vary": {}, "rows": "nowhere:gains", "sampler": {"kind": "list"}}, "rows is 'nowhere:gains'; valid"),
    ],
)
def test_a_name_that_cannot_be_imported_is_refused(section: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(HricError, match=message):
        definition.load(str(sweeps.written(tmp_path, **section)))
