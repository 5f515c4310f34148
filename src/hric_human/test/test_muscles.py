"""The built-in muscles: signs, energy, the fit, fibres, strength, pulls, licence, and what is beyond the range."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import body
from scipy.optimize import linprog, lsq_linear

from hric_core.errors import HricError
from hric_human.control.kinematics import HandChain, own_weight
from hric_human.control.strength import MASS_EXPONENT, MEAN_MASS, STRENGTH
from hric_human.muscles import BUILT_IN, MuscleSet, load

ANATOMY = load(BUILT_IN)
LOWER, UPPER = np.array(ANATOMY.lower), np.array(ANATOMY.upper)
SAMPLES = Path(__file__).parent / "data" / "das4_mended_samples.npz"
"""Lengths, moment arms and pulls that OpenSim computes for the repaired das4_v4.osim at poses not used in the fit."""
FROM_THE_HAND_MODEL = ("ECR", "ECU", "FC", "PL", "PT", "PQ", "FD", "ED", "EI", "EP", "FPL", "APL")
GRAVITY = (0.0, 0.0, -9.81)


def muscles(name: str = "P50_male", parts: str = "right_arm", **changes: Any) -> MuscleSet:
    return MuscleSet(body(name, parts=parts, **changes), ANATOMY)


@cache
def as_measured() -> MuscleSet:
    """The muscles at the size and strength of the model itself."""
    lengths = {"upper_arm": ANATOMY.reference["upper_arm"], "forearm": ANATOMY.reference["forearm"]}
    return muscles(mass=MEAN_MASS["male"], lengths=lengths)


def person(name: str):
    return body(name, parts="right_arm", **({"mass": 75.0, "height": 1.75} if name == "P50_male" else {}))


def pose(**degrees: float) -> list[float]:
    return [np.radians(degrees.get(name, 0.0)) for name in (*ANATOMY.joints, "wr_flex", "wr_dev")]


def poses(count: int, seed: int) -> np.ndarray:
    drawn = np.random.default_rng(seed).uniform(LOWER, UPPER, (count, 5))
    return np.hstack([drawn, np.zeros((count, 2))])


def arm(q: list[float], muscle: str, joint: str) -> float:
    """Return the moment arm of a muscle about a joint [mm]."""
    made = as_measured()
    state = made.at(q, [0.0] * 7)
    return float(1e3 * state.arms[made.names.index(f"right_{muscle}"), ANATOMY.joints.index(joint)])


@pytest.mark.parametrize("elbow", range(5, 131, 5))
def test_flexors_flex_and_every_triceps_line_extends_the_elbow(elbow: int):
    q = pose(el_flex=elbow)
    for flexor in ("bic_l", "bic_b", "brachialis_a", "brachialis_b", "brachiorad"):
        assert arm(q, flexor, "el_flex") > 0.0, flexor
    for extensor in ("tric_long", "tric_med", "tric_lat"):
        assert arm(q, extensor, "el_flex") < -15.0, extensor


@pytest.mark.parametrize("pronation", range(-60, 61, 10))
def test_pronators_pronate_and_the_supinator_supinates(pronation: int):
    q = pose(el_flex=90, pro_sup=pronation)
    assert arm(q, "supinator", "pro_sup") < 0.0
    assert arm(q, "pron_quad", "pro_sup") > 0.0
    assert arm(q, "pron_teres_a", "pro_sup") > 0.0


@pytest.mark.parametrize("flexion", [0, 30, 60])
@pytest.mark.parametrize("abduction", [10, 30])
def test_muscles_of_the_shoulder_have_their_signs(flexion: int, abduction: int):
    q = pose(sh_flex=flexion, sh_abd=abduction, el_flex=30)
    signs = {
        "sh_rot": {"subscap_a": 1, "subscap_b": 1, "subscap_c": 1, "infra_a": -1, "infra_b": -1, "ter_min": -1},
        "sh_abd": {"lat_dorsi_a": -1, "lat_dorsi_b": -1, "ter_maj": -1},
        "sh_flex": {"delt_clav_a": 1, "delt_clav_b": 1},
    }
    for joint, of in signs.items():
        for muscle, sign in of.items():
            assert sign * arm(q, muscle, joint) > 0.0, (muscle, joint)


def test_moment_arms_are_slopes_of_the_lengths():
    made, step = muscles(), 1e-6
    lengths = np.array([muscle.optimal_length for muscle in made.scaled])
    for q in poses(20, 1):
        q = np.clip(q, [*(LOWER + 1e-3), 0, 0], [*(UPPER - 1e-3), 0, 0])
        arms = made.at(q.tolist(), [0.0] * 7).arms[:34]
        for j in range(5):
            ahead, behind = q.copy(), q.copy()
            ahead[j] += step
            behind[j] -= step
            change = made.at(ahead.tolist(), [0.0] * 7).length - made.at(behind.tolist(), [0.0] * 7).length
            assert -change[:34] * lengths / (2.0 * step) == pytest.approx(arms[:, j], abs=1e-9)


def test_constant_tension_does_no_work_over_a_closed_loop():
    made = muscles()
    phase = np.linspace(0.0, 2.0 * np.pi, 2001)[:-1]
    middle, half = 0.5 * (LOWER + UPPER), 0.4 * (UPPER - LOWER)
    turns = np.array([1, 2, 1, 3, 2])
    work = np.zeros(34)
    for t in phase:
        q = middle + half * np.sin(turns * t + np.arange(5))
        dq = half * turns * np.cos(turns * t + np.arange(5))
        work += made.at([*q, 0.0, 0.0], [0.0] * 7).arms[:34, :5] @ dq * (phase[1] - phase[0])
    assert np.abs(work).max() < 1e-9


def test_the_fit_is_near_opensims_samples():
    stored = np.load(SAMPLES)
    rms = []
    for k, name in enumerate(stored["names"]):
        length = ANATOMY.muscles[str(name)].length
        of = [ANATOMY.joints.index(joint) for joint in length.joints]
        q = stored["q"][:, of]
        rms.append(float(np.sqrt(np.mean((-length.gradients(q) - stored["arms"][:, k][:, of]) ** 2))))
    assert max(rms) < 3e-3, dict(zip(stored["names"], rms, strict=True))
    assert np.median(rms) < 1.1e-3


def test_pulls_are_near_opensims_samples_under_the_own_weight():
    stored, made, human = np.load(SAMPLES), muscles(), body(parts="right_arm")
    weight, names = own_weight(human, GRAVITY), [str(name) for name in stored["names"]]
    missed, sizes = {"shoulder": [], "elbow": []}, {"shoulder": [], "elbow": []}
    for n, q in enumerate(stored["q"][:48]):
        full = [*q, 0.0, 0.0]
        state = made.at(full, [0.0] * 7)
        forces = state.forces(static(state, np.array(weight(full)))[0])
        for centre in missed:
            fitted, sampled = np.zeros(3), np.zeros(3)
            for k, name in enumerate(names):
                muscle = ANATOMY.muscles[name]
                force = forces[made.names.index(f"right_{name}")]
                sampled += force * stored[centre][n, k]
                if centre in muscle.pulls:
                    at = q[[ANATOMY.joints.index(joint) for joint in muscle.length.joints]][None]
                    fitted += force * np.array([part.values(at)[0] for part in muscle.pulls[centre]])
            missed[centre].append(np.linalg.norm(fitted - sampled))
            sizes[centre].append(np.linalg.norm(sampled))
    for centre in missed:
        share = np.array(missed[centre]) / np.array(sizes[centre])
        print(
            f"{centre}: {np.median(sizes[centre]):.0f} N, error median {np.median(share):.4f} worst {share.max():.4f}"
        )
        assert np.percentile(share, 95) < 0.02
    assert np.percentile(sizes["shoulder"], 5) > 300.0 and np.percentile(sizes["shoulder"], 95) < 1500.0


def test_fibres_stay_in_their_range_and_passive_torque_small():
    made = as_measured()
    for q in poses(2000, 2):
        state = made.at(q.tolist(), [0.0] * 7)
        assert state.length[:34].min() > 0.35 and state.length[:34].max() < 1.45
        assert np.abs(state.passive @ state.arms).max() < 10.0


@pytest.mark.parametrize("name", ["P50_male", "P05_female", "P50_female", "P95_male"])
def test_the_own_weight_is_held_in_every_pose_of_the_working_range(name: str):
    assert held(person(name), 0.0) == 1.0


def test_five_kilograms_in_the_hand_are_held_in_nearly_every_pose():
    share = held(person("P50_male"), 5.0)
    print(f"5 kg: {share:.3f}")
    assert share >= 0.97


@pytest.mark.parametrize(
    ("joint", "sign", "low", "high", "where"),
    [
        ("el_flex", 1, 60, 95, [pose(el_flex=angle) for angle in (70, 80, 90)]),
        ("el_flex", -1, 30, 70, [pose(el_flex=angle) for angle in (50, 70, 90)]),
        ("sh_abd", 1, 50, 95, [pose(sh_abd=angle, el_flex=30) for angle in (15, 30, 45)]),
        ("sh_flex", 1, 50, 105, [pose(sh_flex=angle, el_flex=30) for angle in (15, 45, 75)]),
    ],
)
def test_strength_is_in_the_published_band(joint: str, sign: int, low: float, high: float, where: list):
    found = [strongest(q, joint, sign) for q in where]
    print(joint, sign, [round(torque) for torque in found])
    assert all(low <= torque <= high for torque in found)


def test_no_muscle_of_the_hand_model_is_in_the_file():
    assert not [name for name in ANATOMY.muscles if name.upper().startswith(FROM_THE_HAND_MODEL) and name.isupper()]
    text = BUILT_IN.read_text()
    assert not [stem for stem in FROM_THE_HAND_MODEL if f'"{stem}' in text]


def test_licence_and_credits_are_shipped():
    licence = (BUILT_IN.parent / "LICENSE.delft").read_text()
    assert "MIT License" in licence and "Aberdeen Biomechanics" in licence
    for word in ("MIT", "Blana", "Klein Breteler", "Chadwick"):
        assert word in ANATOMY.notice


def test_angles_beyond_the_range_are_clamped_and_flagged():
    made, inside = muscles(), pose(sh_flex=110, el_flex=30)
    beyond = pose(sh_flex=150, el_flex=30)
    assert not made.at(inside, [0.0] * 7).outside
    state = made.at(beyond, [0.0] * 7)
    assert state.outside
    assert np.array_equal(state.arms, made.at(inside, [0.0] * 7).arms)


def test_a_left_arm_has_the_muscles_of_the_right_one():
    made, q = muscles(parts="both_arms"), pose(sh_flex=30, el_flex=60)
    state = made.at([*q, *q], [0.0] * 14)
    half = len(made.names) // 2
    assert np.array_equal(state.arms[:half, :7], state.arms[half:, 7:])
    assert np.array_equal(state.gain[:half], state.gain[half:])
    assert not state.arms[:half, 7:].any()


def test_lengths_scale_with_segments_and_strength_with_mass_and_sex():
    man, woman = muscles(), muscles("P50_female")
    of = [{muscle.name: muscle for muscle in made.scaled}["right_brachialis_a"] for made in (man, woman)]
    lengths = [
        np.mean([human.segments[f"right_{name}"].length / ANATOMY.reference[name] for name in ("upper_arm", "forearm")])
        for human in (body("P50_male", parts="right_arm"), body("P50_female", parts="right_arm"))
    ]
    assert [muscle.scale for muscle in of] == pytest.approx(lengths)
    mass = [body(name).subject.mass for name in ("P50_male", "P50_female")]
    heavier = (mass[1] / MEAN_MASS["female"]) / (mass[0] / MEAN_MASS["male"])
    share = STRENGTH["el_flex"].women * heavier**MASS_EXPONENT
    assert of[1].force / of[0].force == pytest.approx(share)


def test_intrinsic_stiffness_is_that_of_springs_in_the_muscles():
    made = muscles()
    state = made.at(pose(sh_flex=20, sh_abd=15, el_flex=80), [0.0] * 7)
    activation = np.full(len(made.names), 0.05)
    stiffness, damping = made.intrinsic(state, activation)
    expected = sum(
        75.0 * force * np.outer(row, row)
        for force, row in zip(state.forces(activation)[:34], state.arms[:34], strict=True)
    )
    assert stiffness == pytest.approx(expected)
    assert damping == pytest.approx(0.05 * stiffness)


def test_a_body_without_arms_and_a_file_that_is_none_are_refused(tmp_path: Path):
    wrong = tmp_path / "x.json"
    wrong.write_text('{"name": "x"}')
    with pytest.raises(HricError, match="fit_muscles"):
        load(wrong)
    with pytest.raises(HricError, match="above 0"):
        MuscleSet(body(parts="right_arm"), ANATOMY, factor=0.0)


def static(state, torque: np.ndarray) -> tuple[np.ndarray, float]:
    """Activations from 0.01 to 1 that come nearest to a torque, with little effort, and what is missing [N m]."""
    matrix = (state.arms * state.gain[:, None]).T
    aim = torque - state.passive @ state.arms
    count = matrix.shape[1]
    rows = np.vstack([1e3 * matrix, np.eye(count)])
    found = lsq_linear(rows, np.concatenate([1e3 * aim, np.zeros(count)]), (0.01, 1.0), tol=1e-12).x
    return found, float(np.abs(matrix @ found - aim).max())


def held(human, load_kg: float) -> float:
    """Share of 1000 seeded poses in which muscles hold the arm, and a load at the palm, 0.5 N m at most missing."""
    made, chain_weight = MuscleSet(human, ANATOMY), own_weight(human, GRAVITY)
    hand = LoadedHand(human)
    good = 0
    drawn = poses(1000, 3)
    for q in drawn:
        torque = np.array(chain_weight(q.tolist())) + hand.torque(q, load_kg)
        state = made.at(q.tolist(), [0.0] * 7)
        good += shortfall(state, torque) <= 0.5
    return good / len(drawn)


def shortfall(state, torque: np.ndarray) -> float:
    """Smallest possible greatest missing torque [N m], by linear programming."""
    matrix = (state.arms * state.gain[:, None]).T
    aim = torque - state.passive @ state.arms
    rows, count = matrix.shape
    ones = np.ones((rows, 1))
    upper = np.vstack([np.hstack([matrix, -ones]), np.hstack([-matrix, -ones])])
    found = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=upper,
        b_ub=np.concatenate([aim, -aim]),
        bounds=[(0.01, 1.0)] * count + [(0.0, None)],
    )
    return float(found.x[-1])


class LoadedHand:
    """Torque that holds a load at the palm, computed from numerical derivatives of its height."""

    def __init__(self, human) -> None:
        self._chain = HandChain(human, "right")

    def torque(self, q: np.ndarray, load_kg: float) -> np.ndarray:
        if load_kg == 0.0:
            return np.zeros(7)
        step = 1e-6
        heights = [
            [self._chain.pose((q + sign * step * unit).tolist()).position[2] for sign in (1.0, -1.0)]
            for unit in np.eye(7)
        ]
        return np.array([load_kg * 9.81 * (high - low) / (2.0 * step) for high, low in heights])


def strongest(q: list[float], joint: str, sign: int) -> float:
    """Greatest torque about a joint in a sense with none about the others [N m]."""
    state = as_measured().at(q, [0.0] * 7)
    matrix, j = (state.arms * state.gain[:, None]).T, ANATOMY.joints.index(joint)
    others = [i for i in range(5) if i != j]
    found = linprog(-sign * matrix[j], A_eq=matrix[others], b_eq=np.zeros(4), bounds=(0.0, 1.0))
    return float(sign * matrix[j] @ found.x)
