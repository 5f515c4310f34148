"""Random trees agree with a rigid-body library and closed forms, whatever their joints, axes and origins."""

from pathlib import Path

import numpy as np
import pytest
from random_robots import TYPES, tree

from hric_core.urdf import read
from urdf_to_osim import Options, convert, prove, write

EVERYTHING = {
    "frames", "mass matrix", "mass matrix / inertia", "gravity", "inverse dynamics",
    "damping", "friction", "stops", "actuators", "effort limits", "couplers",
}  # fmt: skip


def options(seed: int, urdf_xml: str) -> Options:
    random = np.random.default_rng(seed)
    single = [joint.name for joint in read(urdf_xml).joints.values() if joint.type in TYPES[:3]]
    phi = {
        name: dict(
            zip(("phi1", "phi2", "phi3"), random.uniform([0.1, 1.0, -0.1], [2.0, 20.0, 0.1]).tolist(), strict=True)
        )
        for name in single
    }
    friction = "coulomb" if seed % 2 else "sigmoid"
    return Options(
        up="yz"[seed % 2],
        friction=friction,
        friction_parameters=phi if friction == "sigmoid" else {},
        gravity=tuple(random.uniform(-10.0, 10.0, 3)),
    )


def check(seed: int, folder: Path, states: int) -> None:
    urdf_xml = tree(seed)
    choice = options(seed, urdf_xml)
    path = write(convert(urdf_xml, choice), folder / f"tree{seed}.osim").path
    proof = prove(path, urdf_xml, choice, states=states, seed=seed)
    assert proof.passed, f"seed {seed}\n{proof.table()}"
    assert set(proof.errors) == EVERYTHING


@pytest.mark.parametrize("seed", range(50))
def test_fifty_random_trees_with_all_joint_types_convert_with_proof(seed: int, tmp_path: Path) -> None:
    check(seed, tmp_path, 3)


@pytest.mark.slow
def test_fifty_random_trees_stay_within_the_tolerance_over_a_hundred_states(tmp_path: Path) -> None:
    for seed in range(50):
        check(seed, tmp_path, 100)
