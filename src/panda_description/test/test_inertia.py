"""Steiner's theorem and the physical sense of the inertial sets, against published and worked figures."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import panda_description
from hric_core.command import perform
from hric_core.errors import UnknownNameError
from hric_core.geometry import judge
from panda_description import inertial_sets


def test_the_worked_example_of_the_thesis_follows_from_the_signs_of_the_published_table() -> None:
    printed = np.array([[0.5511, -0.0001, 0.0034], [-0.0001, 0.5543, 0.0174], [0.0034, 0.0174, 0.0090]])
    assert_allclose(panda_description.inertials("thesis")["link1"].inertia, printed, rtol=0, atol=5e-5)


@pytest.mark.parametrize(
    ("name", "margins"),
    [
        ("barycentric", [0.004823, 0.000002, 0.001224, 0.003809, 0.000125, 0.000065, 0.001889]),
        ("thesis", [0.004730, -0.000230, -0.036841, -0.073013, -0.000913, -0.007687, 0.001876]),
    ],
)
def test_triangle_margins_of_links_1_to_7(name: str, margins: list[float]) -> None:
    found = [judge(panda_description.inertials(name)[f"link{i}"].inertia).triangle_margin for i in range(1, 8)]
    assert_allclose(found, margins, rtol=0, atol=6e-7)


def test_the_default_set_is_physical_in_every_part() -> None:
    assert inertial_sets.unphysical("barycentric") == {}
    assert len(panda_description.inertials("barycentric")) == 10


def test_the_links_of_the_fr3_have_its_published_mass() -> None:
    links = panda_description.inertials("fr3")
    masses = [links[f"link{i}"].mass for i in range(1, 8)]
    assert_allclose(masses, [2.93, 2.94, 2.24, 2.62, 2.33, 1.82, 0.63], rtol=0, atol=0.006)
    assert sum(masses) == pytest.approx(15.4948, abs=1e-4)


def test_the_links_of_the_fr3_are_physical() -> None:
    assert inertial_sets.unphysical("fr3") == {}


def test_the_thesis_set_is_not_physical_in_links_2_to_6_and_indefinite_in_3_4_and_6() -> None:
    assert sorted(inertial_sets.unphysical("thesis")) == ["link2", "link3", "link4", "link5", "link6"]
    links = panda_description.inertials("thesis")
    assert [i for i in range(1, 8) if not judge(links[f"link{i}"].inertia).positive_definite] == [3, 4, 6]
    negative = {i: judge(links[f"link{i}"].inertia).moments[:2].round(4).tolist() for i in (3, 4, 6)}
    assert negative[3][0] == -0.0178
    assert negative[4] == [-0.0306, -0.0210]
    assert negative[6] == [-0.0024, -0.0021]


def test_an_unknown_set_is_refused_with_the_valid_ones() -> None:
    with pytest.raises(UnknownNameError, match="valid: barycentric, fr3, thesis"):
        panda_description.inertials("best")


def test_the_tool_prints_every_part_and_undoing_steiner_on_the_default_set_shows_the_broken_links(
    capsys: pytest.CaptureFixture[str],
) -> None:
    perform(["inertials"])
    plain = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in plain[2:]] == list(panda_description.inertials())
    assert all("physical" in line for line in plain[2:])
    perform(["inertials", "--steiner", "undo"])
    undone = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()[2:]}
    assert (
        "breaks the triangle inequality by 0.073013" in undone["link4"] and "not positive definite" in undone["link4"]
    )


def test_the_tool_takes_the_thesis_set_back_to_the_published_tensors() -> None:
    back = inertial_sets.moved(panda_description.inertials("thesis"), "apply")
    for i in range(1, 8):
        assert_allclose(back[f"link{i}"].inertia, panda_description.inertials()[f"link{i}"].inertia, rtol=0, atol=1e-12)
