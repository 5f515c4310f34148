"""Fifty descriptions, each spoilt in one place: converted with proof, or refused with one clear error, and no file
then."""

from pathlib import Path

import pytest
from random_robots import spoilt, tree

import panda_description
from hric_core.errors import DescriptionError, HricError
from urdf_to_osim import Options, Proof, convert, prove, write

PANDA = panda_description.load(fingers="prismatic", damping=0.1)


def proved(urdf_xml: str, options: Options, path: Path) -> Proof:
    """Convert, write and prove; a proof that fails stops the writing."""
    proofs = []

    def check(staged: Path) -> None:
        proofs.append(prove(staged, urdf_xml, options, states=3))
        if not proofs[0].passed:
            raise DescriptionError(f"the proof failed\n{proofs[0].table()}")

    write(convert(urdf_xml, options), path, check)
    return proofs[0]


def outcome(urdf_xml: str, options: Options, path: Path) -> str:
    try:
        assert proved(urdf_xml, options, path).passed
    except HricError as error:
        assert list(path.parent.iterdir()) == [], "something was left behind"
        text = str(error)
        assert "\n" not in text and 10 < len(text) < 1000, text
        return "refused"
    assert path.is_file()
    return "converted"


@pytest.mark.parametrize("seed", range(50))
def test_a_spoilt_description_is_converted_with_proof_or_refused_with_one_clear_error(
    seed: int, tmp_path: Path
) -> None:
    panda = seed % 2 == 1
    options = Options(contact=not panda, meshes=not panda or seed % 8 == 1)
    outcome(spoilt(PANDA if panda else tree(seed, joints=8), seed // 2), options, tmp_path / "robot.osim")


def test_the_fifty_are_a_mixture_of_what_is_converted_and_what_is_refused() -> None:
    refused = 0
    for seed in range(0, 50, 2):
        try:
            convert(spoilt(tree(seed, joints=8), seed // 2))
        except HricError:
            refused += 1
    assert 8 <= refused <= 20
