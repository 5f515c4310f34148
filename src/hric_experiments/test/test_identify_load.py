"""hric identify_load on runs of the shipped motion, with realism `measured`: noise, model errors and friction."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from hric_core.command import main

COM = [0.04, -0.05, 0.12]
QUIET = ["--quiet", "--no-figures"]


def recorded(runs: Path, *changes: str, seed: int = 0) -> Path:
    words = ["run", "identify_load", "realism:=measured", *changes, "--seed", str(seed), "--runs", str(runs), *QUIET]
    assert main(words) == 0
    return (runs / "latest").resolve()


def carrying(mass: float) -> str:
    inertia = [2.0e-3, 0, 0, 2.0e-3, 0, 1.0e-3]
    return f"robot.plant.payload:={{mass: {mass}, com: {COM}, inertia: {inertia}, link: panda_link8}}"


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("empty"))


@pytest.mark.parametrize(
    ("mass", "told"),
    [
        (0.5, []),
        pytest.param(1.5, [], marks=pytest.mark.slow),
        pytest.param(3.0, ["robot.load.mass:=2.5"], marks=pytest.mark.slow),
    ],
)
def test_a_payload_is_found_within_two_per_cent_and_three_millimetres(
    empty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], mass: float, told: list[str]
) -> None:
    loaded = recorded(tmp_path, carrying(mass), *told, seed=3)
    output = tmp_path / "load.yaml"
    assert main(["identify_load", str(loaded), "--empty", str(empty), "-o", str(output)]) == 0
    request = yaml.safe_load(output.read_text())
    print(mass, request, capsys.readouterr().out)
    assert request["mass"] == pytest.approx(mass, rel=0.02)
    np.testing.assert_allclose(request["F_x_center_load"], COM, atol=3e-3)


def test_a_motion_that_a_reflex_ended_is_refused(
    empty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ended = recorded(tmp_path, carrying(3.0))
    output = tmp_path / "load.yaml"
    capsys.readouterr()
    assert main(["identify_load", str(ended), "--empty", str(empty), "-o", str(output)]) == 2
    assert "the two logs have different motions" in (error := capsys.readouterr().err) and error.count("\n") == 1
    assert not output.exists()
