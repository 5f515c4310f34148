"""Steiner's theorem and the physical sense of the inertial sets, against published and worked figures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import panda_description
from hric_control.errors import UnknownNameError
from panda_description import inertials_cli
from panda_description.inertia import com_to_origin, judge, origin_to_com, steiner_term, tensor
from panda_description.parameters import unphysical


def test_applying_and_undoing_steiner_gives_the_tensor_back() -> None:
    random = np.random.default_rng(0)
    for _ in range(100):
        mass, com = random.uniform(0.1, 5.0), random.uniform(-0.5, 0.5, 3)
        inertia = tensor(*random.uniform(-1.0, 1.0, 6))
        assert_allclose(origin_to_com(com_to_origin(inertia, mass, com), mass, com), inertia, rtol=0, atol=1e-12)


def test_the_term_is_that_of_a_point_mass_and_does_not_depend_on_the_sign_of_q() -> None:
    assert_allclose(steiner_term(2.0, np.array([0.0, 0.0, 3.0])), np.diag([18.0, 18.0, 0.0]))
    q = np.array([0.1, -0.2, 0.3])
    assert_allclose(steiner_term(1.5, q), steiner_term(1.5, -q))
    assert_allclose(steiner_term(1.0, np.array([1.0, 2.0, 0.0]))[0, 1], -2.0)


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
    assert unphysical("barycentric") == {}
    assert len(panda_description.inertials("barycentric")) == 10


def test_the_thesis_set_is_not_physical_in_links_2_to_6_and_indefinite_in_3_4_and_6() -> None:
    assert sorted(unphysical("thesis")) == ["link2", "link3", "link4", "link5", "link6"]
    links = panda_description.inertials("thesis")
    assert [i for i in range(1, 8) if not judge(links[f"link{i}"].inertia).positive_definite] == [3, 4, 6]
    negative = {i: judge(links[f"link{i}"].inertia).moments[:2].round(4).tolist() for i in (3, 4, 6)}
    assert negative[3][0] == -0.0178
    assert negative[4] == [-0.0306, -0.0210]
    assert negative[6] == [-0.0024, -0.0021]


def test_an_unknown_set_is_refused_with_the_valid_ones() -> None:
    with pytest.raises(UnknownNameError, match="valid: barycentric, thesis"):
        panda_description.inertials("best")


def test_the_tool_prints_every_part_and_undoing_steiner_on_the_default_set_shows_the_broken_links() -> None:
    plain = inertials_cli.run([]).splitlines()
    assert [line.split()[0] for line in plain[2:]] == list(panda_description.inertials())
    assert all("physical" in line for line in plain[2:])
    undone = {line.split()[0]: line for line in inertials_cli.run(["--steiner", "undo"]).splitlines()[2:]}
    assert "breaks the triangle inequality by 0.073013" in undone["link4"] and "not positive definite" in undone["link4"]


def test_the_tool_takes_the_thesis_set_back_to_the_published_tensors() -> None:
    back = inertials_cli.moved(panda_description.inertials("thesis"), "apply")
    for i in range(1, 8):
        assert_allclose(back[f"link{i}"].inertia, panda_description.inertials()[f"link{i}"].inertia, rtol=0, atol=1e-12)
