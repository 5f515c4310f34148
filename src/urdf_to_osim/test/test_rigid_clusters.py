"""Inertia is checked for groups of links that are fixed to each other, not for each link of a group."""

from pathlib import Path

import pytest
from small_robots import BODY, joint, link, robot

from hric_core.errors import DescriptionError
from urdf_to_osim import Conversion, Options, convert, prove, write

AT = '<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>'
NO_BODY = {
    "a mass without inertia": ("0.1", "0", "0"),
    "an inertia without mass": ("0", "0.01", "0.01"),
    "a broken triangle": ("0.1", "0.01", "0.05"),
    "a negative moment": ("0.1", "-0.001", "0.01"),
}


def inertial(mass: str, across: str, along: str) -> str:
    tensor = f'<inertia ixx="{across}" ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{along}"/>'
    return f'<inertial><origin xyz="0 0.1 0"/><mass value="{mass}"/>{tensor}</inertial>'


def arm(flange: str, upper: str = BODY) -> str:
    """A moving link, a flange fixed to it, and a tip that moves on the flange."""
    return robot(
        link("base"), link("upper", upper), link("flange", flange), link("tip"),
        joint("shoulder", "continuous", "base", "upper", ""), joint("hold", "fixed", "upper", "flange", AT),
        joint("wrist", "continuous", "flange", "tip", AT),
    )  # fmt: skip


def proved(urdf_xml: str, folder: Path, options: Options) -> Conversion:
    """Convert a description and prove it against pinocchio; return the conversion."""
    conversion = convert(urdf_xml, options)
    proof = prove(write(conversion, folder / "a.osim").path, urdf_xml, options, states=5)
    assert proof.passed and not proof.repaired
    return conversion


@pytest.mark.parametrize("inertia", ["refuse", "repair", "keep"])
@pytest.mark.parametrize("name", NO_BODY)
def test_a_link_that_is_no_body_is_one_with_what_it_is_fixed_to(name: str, inertia: str, tmp_path: Path) -> None:
    conversion = proved(arm(inertial(*NO_BODY[name])), tmp_path, Options(inertia=inertia))
    assert [note for note in conversion.notes if "flange" in note] == [
        "link flange: its inertia is impossible, but possible together with the links fixed to it; link upper has the "
        "sum"
    ]
    assert conversion.frames["flange"].path == "/bodyset/upper/flange"


def test_a_moving_link_that_is_no_body_is_one_with_a_flange_that_is(tmp_path: Path) -> None:
    proved(arm(BODY, inertial(*NO_BODY["a mass without inertia"])), tmp_path, Options())


def test_links_that_are_bodies_stay_bodies_of_their_own(tmp_path: Path) -> None:
    conversion = proved(arm(BODY), tmp_path, Options())
    assert conversion.frames["flange"].path == "/bodyset/flange" and not conversion.notes


@pytest.mark.parametrize("name", list(NO_BODY)[1:])
def test_links_that_are_no_body_together_either_are_refused_by_the_name_of_one(name: str) -> None:
    wrong = inertial(*NO_BODY[name])
    with pytest.raises(
        DescriptionError, match=r"^link upper: .*; correct its <inertial>, or convert with inertia repair"
    ):
        convert(arm(wrong, wrong))
