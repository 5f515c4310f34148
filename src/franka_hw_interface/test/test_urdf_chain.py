import numpy as np
import pinocchio as pin
import pytest

from franka_hw_interface.kdl_chain import KdlChain
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.urdf_chain import parse_chain
from hric_core.errors import CommandError, DescriptionError, UnknownNameError

INERTIAL = (
    '<inertial><origin xyz="0.02 -0.03 0.1" rpy="0.3 0.2 -0.4"/><mass value="{m}"/>'
    '<inertia ixx="0.03" ixy="0.001" ixz="-0.002" iyy="0.04" iyz="0.003" izz="0.02"/></inertial>'
)


def link(name: str, mass: float = 0.0) -> str:
    return f'<link name="{name}">{INERTIAL.format(m=mass) if mass else ""}</link>'


def joint(name: str, kind: str, parent: str, child: str, axis: str = "0.6 0 0.8") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="0.1 0.2 -0.3" rpy="0.5 -0.6 0.7"/><parent '
        f'link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
    )


# Turns, slides, a fixed link with mass on the way, a branch with a fixed and a movable joint at it, and mass behind the
# tip.
ARM = "".join(
    [
        '<robot name="arm">',
        link("world"),
        link("base", 9.0),
        link("a", 1.0),
        link("mid", 0.7),
        link("b", 2.0),
        link("c", 1.5),
        link("tool", 0.4),
        link("beyond", 0.3),
        link("box", 0.5),
        link("flap", 0.2),
        joint("mount", "fixed", "world", "base"),
        joint("turn", "revolute", "base", "a", "2 0 0"),
        joint("weld", "fixed", "a", "mid"),
        joint("slide", "prismatic", "mid", "b"),
        joint("spin", "revolute", "b", "c", "0 -1 0"),
        joint("hold", "fixed", "c", "tool"),
        joint("more", "fixed", "tool", "beyond"),
        joint("side", "fixed", "mid", "box"),
        joint("hinge", "revolute", "box", "flap"),
        "</robot>",
    ]
)


def test_any_arm_equals_the_second_library_with_everything_fixed_to_it() -> None:
    chain = KdlChain(ARM, "base", "tool")
    assert chain.joint_names == ("turn", "slide", "spin")
    assert chain.description.frozen_joints == ("hinge",)
    full = pin.buildModelFromXML(ARM)
    model = pin.buildReducedModel(full, [full.getJointId("hinge")], np.zeros(full.nq))
    data, rng = model.createData(), np.random.default_rng(1)
    base, tool = model.getFrameId("base"), model.getFrameId("tool")
    for _ in range(50):
        q, dq = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
        M = np.triu(pin.crba(model, data, q))
        g = pin.computeGeneralizedGravity(model, data, q)
        c = pin.nonLinearEffects(model, data, q, dq) - g
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        pin.framesForwardKinematics(model, data, q)
        turn = np.kron(np.eye(2), data.oMf[base].rotation.T)
        T = (data.oMf[base].inverse() * data.oMf[tool]).homogeneous
        expected = (M + np.triu(M, 1).T, g, g, c, turn @ J, T)
        found = (
            chain.mass(q),
            chain.gravity(q),
            chain.gravity_list(q.tolist()),
            chain.coriolis(q, dq),
            chain.jacobian(q),
            chain.pose(q),
        )
        for ours, theirs in zip(found, expected, strict=True):
            assert np.abs(np.asarray(ours) - theirs).max() < 1e-12


def test_a_continuous_joint_counts_as_revolute() -> None:
    assert (
        parse_chain(ARM.replace('name="turn" type="revolute"', 'name="turn" type="continuous"'), "base", "tool")
        .segments[0]
        .kind
        == "revolute"
    )


@pytest.mark.parametrize(
    ("urdf", "root", "tip", "error", "said"),
    [
        ("<robot", "a", "b", DescriptionError, "not XML"),
        (ARM, "base", "hand", UnknownNameError, "no link 'hand'.*valid: a, b, base"),
        (ARM, "tool", "base", DescriptionError, "base is not a descendant of link tool"),
        (ARM, "c", "tool", DescriptionError, "no moving joint between c and tool"),
        (
            ARM.replace("revolute", "floating"),
            "base",
            "tool",
            DescriptionError,
            "turn between base and tool is floating; valid: fixed, revolute",
        ),
        (
            ARM.replace('<axis xyz="2 0 0"/>', '<axis xyz="0 0 0"/>'),
            "base",
            "tool",
            DescriptionError,
            "joint turn: its axis .* has length 0",
        ),
        (ARM.replace('<mass value="2.0"/>', ""), "base", "tool", DescriptionError, "link b"),
        (
            ARM.replace('xyz="0.1 0.2 -0.3"', 'xyz="0.1 0.2"', 1),
            "base",
            "tool",
            DescriptionError,
            "mount: xyz of <origin> must be 3 numbers",
        ),
        (ARM.replace('type="fixed"', 'type="planar"', 1), "base", "tool", DescriptionError, "base is moved by a joint"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused_by_element(urdf, root, tip, error, said) -> None:
    with pytest.raises(error, match=said):
        KdlChain(urdf, root, tip)


def test_an_arm_without_seven_joints_is_no_franka_arm() -> None:
    urdf = ARM.replace('"base"', '"arm_link0"').replace('"tool"', '"arm_link8"')
    with pytest.raises(DescriptionError, match="3 moving joints between arm_link0 and arm_link8; a Franka arm has 7"):
        KdlFrankaModel(urdf, "arm")


def test_vectors_of_the_wrong_length_are_refused() -> None:
    chain = KdlChain(ARM, "base", "tool")
    with pytest.raises(CommandError, match="joint velocity has 2 values for 3 joints"):
        chain.coriolis([0.0] * 3, [0.0] * 2)
    with pytest.raises(CommandError, match="gravity must be three"):
        chain.gravity([0.0] * 3, [0.0, 1.0])
