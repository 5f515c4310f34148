"""Links without mass or inertia: same motion on every engine and in pinocchio."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest

from hric_core.errors import DescriptionError

BODY = """<inertial><origin xyz="0.1 0.02 0.3"/><mass value="2"/>
  <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial>"""
POINT = (
    BODY.replace("0.02 0.3", "0.2 0.3")
    .replace('ixx="0.02"', 'ixx="0"')
    .replace("0.03", "0")
    .replace('izz="0.01"', 'izz="0"')
)
SPIN = BODY.replace('value="2"', 'value="0"')
NAMES = ["x", "y", "z"]


def chain(*inside: str, fixed: str = "") -> str:
    """Return the URDF of three links that turn about x, y and z in series, with elements fixed to the last one."""
    links = "".join(f'<link name="{name}">{inertial}</link>' for name, inertial in zip(NAMES, inside, strict=True))
    joints = "".join(
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{name}"/><axis xyz="{axis}"/>'
        f'<origin xyz="0 0.1 0"/></joint>'
        for name, parent, axis in zip(NAMES, ("base", "x", "y"), ("1 0 0", "0 1 0", "0 0 1"), strict=True)
    )
    tail = f'<link name="t">{fixed}</link><joint name="f" type="fixed"><parent link="z"/><child link="t"/></joint>'
    return f'<robot name="r"><link name="base"/>{links}{joints}{tail}</robot>'


LIGHT = {
    "links without mass before one with it": chain("", "", BODY),
    "a link without inertial between two": chain(BODY, "", BODY),
    "point masses": chain(POINT, POINT, BODY),
    "a tail that has it all": chain("", "", "", fixed=BODY),
    "a tail without mass, which has an inertia": chain(BODY, BODY, BODY, fixed=SPIN),
    "a point mass fixed to a body": chain(BODY, BODY, BODY, fixed=POINT),
}


def acceleration(urdf: str, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> np.ndarray:
    model = pin.buildModelFromXML(urdf.replace('type="continuous"', 'type="revolute"').replace(
        '</joint>', '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'))  # fmt: skip
    data = model.createData()
    M = pin.crba(model, data, np.array(q))
    M = np.triu(M) + np.triu(M, 1).T
    return np.linalg.solve(M, np.array(tau) - pin.rnea(model, data, np.array(q), np.array(dq), np.zeros(3)))


@pytest.mark.parametrize("name", LIGHT)
def test_a_step_is_that_of_the_description(name: str, make_plant) -> None:
    q, dq, tau = [0.3, -0.5, 0.7], [0.2, 0.4, -0.3], [0.5, -0.2, 0.1]
    plant = make_plant(
        LIGHT[name], NAMES, rotor_inertia=0.0, time_step=1e-5, integrator="semi_implicit", half_step_readout=False
    )
    plant.reset(q, dq)
    after = [0.0] * 3, [0.0] * 3, [0.0] * 3
    plant.apply(tau)
    plant.step()
    plant.read_state(*after)
    found = (np.array(after[1]) - dq) / 1e-5
    assert found == pytest.approx(acceleration(LIGHT[name], q, dq, tau), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("urdf", [chain(BODY, BODY, ""), chain(BODY, "", ""), chain(BODY, BODY, SPIN)])
def test_a_link_that_nothing_with_mass_follows_is_refused(urdf: str, make_plant) -> None:
    with pytest.raises(DescriptionError, match=r"^link [yz]: .*(mass|inertial)") as error:
        make_plant(urdf, NAMES)
    assert "\n" not in str(error.value)


ROD = """<inertial><origin xyz="0 0 0.3"/><mass value="1"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="{}"/></inertial>"""
"""Link whose centre of mass is on the z axis, about which it has the given moment [kg m^2]."""


def test_a_thin_rod_on_the_axis_moves_with_its_rotor(make_plant) -> None:
    plant = make_plant(chain(BODY, BODY, ROD.format(0)), NAMES, [0.0] * 3, rotor_inertia=0.1, gravity=[0.0] * 3)
    after = [0.0] * 3, [0.0] * 3, [0.0] * 3
    for _ in range(10):
        plant.apply([0.0, 0.0, 0.5])
        plant.step()
    plant.read_state(*after)
    assert after[1][2] == pytest.approx(0.05, rel=1e-4)


@pytest.mark.parametrize(("moment", "rotor"), [(-0.5, 0.1), (-0.005, 0.0), (0.0, 0.0)])
def test_a_joint_whose_motion_nothing_resists_is_refused(moment: float, rotor: float, make_plant) -> None:
    with pytest.raises(DescriptionError, match=r"^joint z: .* inertia about .* kg m\^2") as error:
        make_plant(chain(BODY, BODY, ROD.format(moment)), NAMES, [0.0] * 3, rotor_inertia=rotor)
    assert "\n" not in str(error.value)


def test_an_impossible_tensor_enters_the_mass_matrix_as_described(make_plant) -> None:
    plant = make_plant(chain(BODY, BODY, ROD.format(0.1)), NAMES, [0.0] * 3)
    assert plant.mass_matrix()[2, 2] == pytest.approx(0.1)


def test_a_joint_that_is_named_twice_is_refused(make_plant) -> None:
    with pytest.raises(DescriptionError, match="robot r: joint x is named twice"):
        make_plant(chain(BODY, BODY, BODY), ["x", "y", "x"])
