"""The model library that the box serves, called by ctypes as libfranka calls it, against KDL."""

import ctypes
from collections.abc import Callable, Iterator
from ctypes import c_double
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.transforms import FloatArray, column_major
from franka_sim.model_library import FUNCTIONS, MARKER, library_for
from franka_sim.model_library.parameters import arm_chain, arm_without_tool
from hric_core.errors import DescriptionError, UnknownNameError
from hric_core.geometry import transform_from_rpy
from hric_core.urdf import read

STATES, TOLERANCE = 200, 1e-9
PAYLOAD = (
    2.3,
    (0.03, -0.05, 0.12),
    np.array([[0.012, 0.001, -0.002], [0.001, 0.016, 0.0007], [-0.002, 0.0007, 0.009]]),
)
CASES: dict[str, dict[str, Any]] = {
    "bare": {"hand": False},
    "hand": {},
    "thesis inertials, movable fingers, tilted": {"rpy": "0.4 -0.7 1.2", "fingers": "prismatic", "inertials": "thesis"},
    "payload, tilted, another arm_id": {"arm_id": "left", "rpy": "-1.1 0.3 0.2", "load": PAYLOAD},
}


def description(**arguments: Any) -> str:
    return panda_description.load(meshes=False, collision=False, **arguments)


class Library:
    """The functions with their C signatures; numpy in, numpy out."""

    def __init__(self, data: bytes, folder: Path) -> None:
        path = folder / f"{hash(data)}.so"
        path.write_bytes(data)
        self._functions = ctypes.CDLL(str(path))

    def __call__(self, name: str, size: int, *arguments: Any) -> FloatArray:
        out = (c_double * size)(*[np.nan] * size)
        function = getattr(self._functions, name)
        function.restype = None
        function(*(c_double(a) if isinstance(a, float) else (c_double * len(a))(*a) for a in arguments), out)
        return np.array(out)


class Pair:
    """The library and KDL of one arm, told the same end effector and payload."""

    def __init__(self, folder: Path, arm_id: str = "panda", load: Any = None, **arguments: Any) -> None:
        urdf = description(arm_id=arm_id, **arguments)
        self.library = Library(library_for(urdf, arm_id), folder)
        self.kdl = KdlFrankaModel(urdf, arm_id)
        if load is not None:
            self.kdl.set_load(*load)
        total = self.kdl.total_inertial
        self.tensor, self.mass, self.com = column_major(total.inertia), total.mass, total.com.tolist()


@pytest.fixture(params=CASES.values(), ids=CASES.keys())
def pair(request: pytest.FixtureRequest, tmp_path: Path) -> Pair:
    return Pair(tmp_path, **request.param)


def states(seed: int = 5) -> Iterator[tuple[list[float], list[float]]]:
    rng = np.random.default_rng(seed)
    for _ in range(STATES):
        yield rng.uniform(-3.0, 3.0, 7).tolist(), rng.uniform(-2.5, 2.5, 7).tolist()


def test_mass_matrix_coriolis_and_gravity_equal_kdl_over_200_states(pair: Pair) -> None:
    worst = np.zeros(4)
    tilted = [1.7, -3.1, -8.2]
    for q, dq in states():
        found = (
            pair.library("M_NE", 49, q, pair.tensor, pair.mass, pair.com).reshape(7, 7).T - pair.kdl.mass(q),
            pair.library("c_NE", 7, q, dq, pair.tensor, pair.mass, pair.com) - pair.kdl.coriolis(q, dq),
            pair.library("g_NE", 7, q, pair.kdl.gravity_base.tolist(), pair.mass, pair.com) - pair.kdl.gravity(q),
            pair.library("g_NE", 7, q, tilted, pair.mass, pair.com) - pair.kdl.gravity(q, tilted),
        )
        worst = np.maximum(worst, [np.abs(difference).max() for difference in found])
    assert (worst < TOLERANCE).all(), f"mass, Coriolis, gravity, tilted gravity differ by {worst}"


def frame_functions(
    end_effector: list[float],
) -> Iterator[tuple[FrankaFrame, int, Callable[[list[float]], tuple[Any, ...]], bool]]:
    """Yield each frame: KDL's frame, number in the symbol, arguments from q, whether the Jacobian needs q."""
    for i in range(1, 8):
        yield FrankaFrame(f"joint{i}"), i, lambda q: (q,), i > 1
    yield FrankaFrame.FLANGE, 8, lambda q: (q,), True
    yield FrankaFrame.END_EFFECTOR, 9, lambda q: (q, end_effector), True


def test_poses_and_both_jacobians_of_all_frames_equal_kdl_column_major_over_200_states(pair: Pair) -> None:
    F_T_EE = transform_from_rpy((0.01, 0.02, 0.2), (0.3, -0.4, 0.5))
    pair.kdl.set_ee(F_T_EE)
    worst: dict[FrankaFrame, FloatArray] = {}
    for q, _ in states():
        for frame, i, arguments, takes_q in frame_functions(column_major(F_T_EE)):
            given = arguments(q) if takes_q else ()
            difference = (
                pair.library(f"O_T_J{i}", 16, *arguments(q)).reshape(4, 4).T - pair.kdl.pose(frame, q),
                pair.library(f"O_J_J{i}", 42, *given).reshape(7, 6).T - pair.kdl.zero_jacobian(frame, q),
                pair.library(f"Ji_J_J{i}", 42, *given).reshape(7, 6).T - pair.kdl.body_jacobian(frame, q),
            )
            worst[frame] = np.maximum(worst.get(frame, 0.0), [np.abs(part).max() for part in difference])
    assert len(worst) == 9
    assert (np.array(list(worst.values())) < TOLERANCE).all(), f"pose, zero and body Jacobian differ by {worst}"


def test_a_joints_jacobian_stays_zero_behind_it(tmp_path: Path) -> None:
    library = Pair(tmp_path).library
    q = [0.3] * 7
    assert np.array_equal(library("O_J_J1", 42), [0, 0, 0, 0, 0, 1, *[0] * 36])
    assert not library("O_J_J4", 42, q).reshape(7, 6)[4:].any()
    assert np.abs(library("O_J_J4", 42, q).reshape(7, 6)[:4]).max(axis=1).all()


def test_all_30_symbols_of_libfranka_are_there_and_nothing_else_is_exported(tmp_path: Path) -> None:
    path = tmp_path / "model.so"
    path.write_bytes(library_for(description()))
    library = ctypes.CDLL(str(path))
    assert len(set(FUNCTIONS)) == 30 and all(hasattr(library, name) for name in FUNCTIONS)
    assert not hasattr(library, "forward") and not hasattr(library, "add_cross") and not hasattr(library, "parameters")


def test_the_library_has_one_place_for_parameters_and_two_arms_in_one_process_keep_their_own(tmp_path: Path) -> None:
    panda, heavy = Pair(tmp_path), Pair(tmp_path, inertials="thesis")
    assert library_for(description()).count(MARKER) == 1
    q = [0.3] * 7
    for pair in (panda, heavy):
        mass = pair.library("M_NE", 49, q, pair.tensor, pair.mass, pair.com).reshape(7, 7)
        assert np.abs(mass - pair.kdl.mass(q)).max() < TOLERANCE


def test_what_hangs_on_the_flange_is_left_out_of_the_library_and_is_what_the_box_reports_as_end_effector() -> None:
    bare, hand, movable = (description(**arguments) for arguments in ({"hand": False}, {}, {"fingers": "prismatic"}))
    assert library_for(bare) == library_for(hand) == library_for(movable)
    chain, kdl = arm_chain(hand, "panda"), KdlFrankaModel(hand, "panda")
    whole = chain.with_load(kdl.ee_inertial).segments[-1].inertial
    assert kdl.ee_inertial.mass == pytest.approx(0.76)
    assert chain.segments[-1].inertial.mass == pytest.approx(whole.mass - 0.76)
    assert np.allclose(whole.inertia, kdl.chain.description.segments[-1].inertial.inertia, rtol=0, atol=1e-15)


def test_the_description_without_tool_ends_at_the_flange() -> None:
    robot = arm_without_tool(read(description(fingers="prismatic")), "panda")
    assert set(robot.links) - {"world", "base"} == {f"panda_link{i}" for i in range(9)}
    assert robot.links["panda_link8"].mass is None
    assert not [name for name in robot.joints if "finger" in name]


def test_an_arm_that_is_no_franka_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="no link 'left_link8'"):
        library_for(description(), "left")
    with pytest.raises(DescriptionError, match="rotate about z of their own frames"):
        library_for(description().replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', 1))
    fixed = ElementTree.fromstring(description())
    next(joint for joint in fixed.findall("joint") if joint.get("name") == "panda_joint3").set("type", "fixed")
    with pytest.raises(DescriptionError, match="6 moving joints"):
        library_for(ElementTree.tostring(fixed, encoding="unicode"))
