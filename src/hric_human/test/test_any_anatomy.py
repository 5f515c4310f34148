"""Arm models chosen by a user: their fit compared with OpenSim, matching of their joints, and refused models."""

import logging
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import built_arm
import mujoco
import numpy as np
import opensim
import pytest
import wrapless
from arm26_model import COORDINATES, FILE, Arm26
from bodies import Posed, body
from scipy.spatial.transform import Rotation

import urdf_to_osim
from hric_core.errors import HricError, ParameterError
from hric_human.muscles import BUILT_IN, Anatomy, MuscleSet, load
from hric_human.muscles.choose import NAME, find
from hric_human.muscles.fitting import any_arm
from hric_human.muscles.fitting.models import NON_COMMERCIAL, content, run
from hric_human.muscles.fitting.mujoco_model import MujocoArm
from hric_human.muscles.fitting.opensim_model import OpenSimArm
from hric_human.muscles.fitting.placing import Placing
from hric_human.muscles.opensim_paths import with_muscles

WHERE = "human.muscles.anatomy"
NEAR, DISAGREES = (1e-3, 1e-3), (2.5e-3, 3.5e-3)
"""Largest root mean square errors of length and moment arm [m], and those of TRIlong.

In OpenSim, the moment arm of TRIlong about the shoulder differs from the slope of its length there by 2.8 mm.
"""
C = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from axes x forward, y up, z right to axes x forward, y left, z up."""


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "hric" / "muscles"


@cache
def arm26_anatomy() -> Anatomy:
    return any_arm.fit(OpenSimArm(FILE), FILE.name)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("built") / "built.osim"
    built_arm.write(path)
    return path


def poses(anatomy: Anatomy, count: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(anatomy.lower, anatomy.upper, (count, len(anatomy.joints)))


def test_the_fit_of_arm26_is_near_opensims_lengths_and_moment_arms():
    anatomy, arm = arm26_anatomy(), Arm26()
    assert anatomy.joints == tuple(COORDINATES)
    length, moment_arm = {name: [] for name in arm.names}, {name: [] for name in arm.names}
    for q in poses(anatomy, 200):
        arm.put(q, np.zeros(2))
        theirs = arm.arms()
        for name, path, row in zip(arm.names, arm.paths.lengths(), theirs, strict=True):
            ours = anatomy.muscles[name].length
            columns = [anatomy.joints.index(joint) for joint in ours.joints]
            length[name].append(ours.values(q[None, columns])[0] - path)
            moment_arm[name].append(np.abs(-ours.gradients(q[None, columns])[0] - row[columns]).max())
    for name, allowed in (dict.fromkeys(arm.names, NEAR) | {"TRIlong": DISAGREES}).items():
        missed = [np.sqrt(np.mean(np.square(of[name]))) for of in (length, moment_arm)]
        print(f"{name}: length {1e3 * missed[0]:.2f} mm rms, moment arm {1e3 * missed[1]:.2f} mm rms")
        assert missed[0] < allowed[0] and missed[1] < allowed[1]


def test_strength_of_arm26_is_that_of_its_file_along_the_line_of_action():
    model = opensim.Model(str(FILE))
    muscles = model.getMuscles()
    for name, ours in arm26_anatomy().muscles.items():
        muscle = muscles.get(name)
        along = np.cos(muscle.getPennationAngleAtOptimalFiberLength())
        assert ours.max_force == pytest.approx(along * muscle.getMaxIsometricForce())
        assert ours.optimal_length == pytest.approx(along * muscle.getOptimalFiberLength())
        assert ours.slack_length == pytest.approx(muscle.getTendonSlackLength())


def test_joints_that_a_model_lacks_have_ideal_actuators():
    made = MuscleSet(body(parts="right_arm"), arm26_anatomy())
    ideal = {name[:-1] for name, is_one in zip(made.names, made.is_muscle, strict=True) if not is_one}
    assert ideal == {f"right_{name}" for name in ("sh_abd", "sh_rot", "pro_sup", "wr_flex", "wr_dev")}
    assert len(made.joints) == 7


def test_coordinates_of_another_order_sense_and_zero_put_the_bones_where_ours_are(built: Path):
    model, human = OpenSimArm(built), body(parts="right_arm")
    placing = Placing(model)
    assert placing.joints == tuple(name.removeprefix("right_") for name in human.joints)
    draw, reached = np.random.default_rng(1), 0
    lower, upper = np.radians([any_arm.WORKING[name] for name in placing.joints]).T
    for q in [np.zeros(7), *draw.uniform(lower, upper, (25, 7))]:
        if placing.put(q):
            R_humerus, R_hand = model.frame("humerus_r")[0] @ built_arm.R_HUMERUS, model.frame("hand_r")[0]
            posed = Posed(human, **dict(zip(human.joints, np.degrees(q), strict=True)))
            for segment, R in (("right_upper_arm", R_humerus), ("right_hand", R_hand @ palm_medial())):
                link = human.segments[segment].link
                ours = posed.data.oMf[posed.model.getFrameId(link)].rotation
                assert pytest.approx(ours, abs=1e-6) == C @ R @ C.T
            girdle = model.frame("clavicle_r")[0]
            elevation = np.arccos(np.clip((C @ R_humerus @ C.T)[2, 2], -1.0, 1.0))
            assert np.arccos(np.clip(girdle[1, 1], -1.0, 1.0)) > 0.05 or elevation < 1.0
            reached += 1
    assert reached > 18


def palm_medial() -> np.ndarray:
    """Return the rotation from the hand's axes at our zero pose (palm medial) to the model's (palm forward)."""
    return np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


@pytest.mark.slow
def test_a_whole_arm_with_a_coupled_girdle_is_fitted(built: Path, caplog: pytest.LogCaptureFixture):
    with caplog.at_level(logging.INFO, "hric"):
        anatomy = find(str(built), WHERE)
    assert anatomy.joints == ("sh_flex", "sh_abd", "sh_rot", "el_flex", "pro_sup", "wr_flex", "wr_dev")
    assert set(anatomy.muscles) == set(built_arm.PATHS) - {"of_the_trunk"}
    assert "of_the_trunk is left out: it acts on none of these joints" in caplog.text
    assert anatomy.muscles["biceps"].length.joints == anatomy.joints[:5]
    assert set(anatomy.muscles["flexor"].pulls) == set()
    assert set(anatomy.muscles["pronator"].pulls) == {"elbow"}
    model = OpenSimArm(built)
    placing, missed = Placing(model), []
    for q in poses(anatomy, 60):
        if placing.put(q):
            lengths = dict(zip(model.muscles, model.lengths(), strict=True))
            for name, muscle in anatomy.muscles.items():
                columns = [anatomy.joints.index(joint) for joint in muscle.length.joints]
                missed.append(muscle.length.values(q[None, columns])[0] - lengths[name])
    assert np.sqrt(np.mean(np.square(missed))) < 0.5e-3
    assert max(error.arm_rms for error in anatomy.errors.values()) < 1.5e-3


def test_a_mujoco_model_gives_what_the_same_model_gives_in_opensim(tmp_path: Path):
    osim, xml = tmp_path / "plain.osim", tmp_path / "plain.xml"
    osim.write_text(wrapless.opensim_text())
    wrapless.write_mujoco(xml, osim)
    models = OpenSimArm(osim), MujocoArm(xml)
    arms = [Placing(model) for model in models]
    assert arms[0].joints == arms[1].joints == tuple(COORDINATES)
    for q in np.random.default_rng(3).uniform((-0.3, 0.1), (1.6, 2.0), (20, 2)):
        assert all(arm.put(q) for arm in arms)
        assert models[0].lengths() == pytest.approx(models[1].lengths(), abs=1e-9)
        assert arms[0].slopes(q) == pytest.approx(arms[1].slopes(q), abs=1e-7)
        ours, theirs = arms[0].pulls(), arms[1].pulls()
        for centre, pull in ours.items():
            assert pull == pytest.approx(theirs[centre], abs=1e-6)
    theirs = models[1].strengths()
    model = opensim.Model(str(osim))
    muscles = model.getMuscles()
    for k, name in enumerate(models[1].muscles):
        muscle = muscles.get(name)
        numbers = muscle.getMaxIsometricForce(), muscle.getOptimalFiberLength(), muscle.getTendonSlackLength()
        assert [values[k] for values in theirs] == pytest.approx(numbers)


def test_a_model_is_fitted_once_and_again_when_its_file_changes(
    tmp_path: Path, own_cache: Path, caplog: pytest.LogCaptureFixture
):
    path = tmp_path / "mine.osim"
    shutil.copy(FILE, path)
    first = find(str(path), WHERE)
    assert "fitting the muscles of" in caplog.text
    caplog.clear()
    assert find(str(path), WHERE) == first
    assert "are fitted" not in caplog.text
    path.write_text(path.read_text().replace("<!--Units for all lengths.-->", ""))
    find(str(path), WHERE)
    assert "fitting the muscles of" in caplog.text
    assert len(list(own_cache.iterdir())) == 2


def test_a_damaged_fit_is_made_again(own_cache: Path, caplog: pytest.LogCaptureFixture):
    first = find(str(FILE), WHERE)
    (kept,) = own_cache.iterdir()
    kept.write_text(kept.read_text()[:1000])
    assert find(str(FILE), WHERE) == first
    assert "is damaged" in caplog.text
    assert load(kept) == first


def test_an_arm_of_myo_sim_says_that_its_terms_are_non_commercial(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    path = tmp_path / "site-packages" / "myo_sim" / "models" / "arm.osim"
    path.parent.mkdir(parents=True)
    shutil.copy(FILE, path)
    for _ in range(2):
        caplog.clear()
        assert find(str(path), WHERE).notice.startswith(NON_COMMERCIAL)
        assert "non-commercial" in caplog.text
    assert "non-commercial" not in find(str(FILE), WHERE).notice


def test_the_built_in_anatomy_and_a_fitted_file_are_found(tmp_path: Path):
    assert find(NAME, WHERE) == load(BUILT_IN)
    arm26_anatomy().save(tmp_path / "mine.json")
    assert find(str(tmp_path / "mine.json"), WHERE) == arm26_anatomy()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda text: "no model", "is no model of an arm"),
        (lambda text: "<a/>", "not an OpenSim model"),
        (lambda text: text.replace("ulna", "shin"), "it needs a body named ulna, distal to one named humerus"),
        (lambda text: without(text, "ForceSet"), "has no muscles"),
        (lambda text: text.replace("<locked>false", "<locked>true"), "no coordinate that bends the elbow"),
        (lambda text: text.replace("r_humerus", "l_humerus").replace("r_ulna", "l_ulna"), "no right arm"),
    ],
)
def test_a_file_without_an_arm_is_refused_with_its_parameter_and_what_is_valid(tmp_path: Path, change, expected: str):
    path = tmp_path / "x.osim"
    path.write_text(change(FILE.read_text()))
    with pytest.raises(ParameterError) as error:
        find(str(path), WHERE)
    assert WHERE in str(error.value) and expected in str(error.value) and "alid: delft" in str(error.value)


def of_all(text: str, tag: str, value: str, count: int = 0) -> str:
    """Return the text of a model with another value of a property, in all muscles or in the first `count` of them."""
    return re.sub(rf"<{tag}>[^<]*</{tag}>", f"<{tag}>{value}</{tag}>", text, count=count)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda text: of_all(text, "max_isometric_force", "0"), "6 of the 6 muscles of the arm cannot be used; "),
        (lambda text: of_all(text, "max_isometric_force", "-1"), "the first is TRIlong: its strength is -0.978"),
        (lambda text: of_all(text, "max_isometric_force", "0", 3), "3 of the 6 muscles of the arm cannot be used"),
        (lambda text: of_all(text, "tendon_slack_length", "nan"), "its tendon nan m; valid: strength and fibres above"),
        (lambda text: of_all(text, "optimal_fiber_length", "inf"), "its fibres are inf m long"),
        (
            lambda text: of_all(text, "optimal_fiber_length", "0"),
            "must be greater than zero). In Component '/forceset/",
        ),
        (lambda text: of_all(text, "max_contraction_velocity", "0"), "its max_contraction_velocity is 0; valid"),
        (
            lambda text: on_humerus(text),
            "none of its 6 muscles changes its length when sh_flex, el_flex move; its first",
        ),
    ],
)
def test_a_model_without_usable_muscles_is_refused_before_it_is_sampled(
    tmp_path: Path, change: Callable[[str], str], expected: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "x.osim"
    path.write_text(change(FILE.read_text()))
    with caplog.at_level(logging.INFO, "hric"), pytest.raises(ParameterError) as error:
        find(str(path), WHERE)
    assert expected in str(error.value) and "\n" not in str(error.value) and "poses sampled" not in caplog.text


def on_humerus(text: str) -> str:
    """Return the text of a model whose muscles begin and end on the humerus, without wrapping."""
    start, end = text.index("<ForceSet "), text.index("</ForceSet>")
    forces = re.sub(r"/bodyset/\w+(?=</socket_parent_frame>)", "/bodyset/r_humerus", text[start:end])
    forces = re.sub(r"(?s)<PathWrapSet\b.*?</PathWrapSet>", "", forces)
    return text[:start] + forces + text[end:]


def test_one_muscle_that_cannot_be_used_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "x.osim"
    path.write_text(of_all(FILE.read_text(), "max_isometric_force", "0", 1))
    assert set(any_arm.fit(OpenSimArm(path), "x").muscles) == {*arm26_anatomy().muscles} - {"TRIlong"}
    assert "muscle TRIlong is left out: its strength is 0 N" in caplog.text


def without(text: str, element: str) -> str:
    start, end = text.index(f"<{element} "), text.index(f"</{element}>")
    return text[:start] + text[end + len(element) + 3 :]


def test_a_mujoco_model_without_muscles_and_one_that_is_none_are_refused(tmp_path: Path):
    path = tmp_path / "x.xml"
    for text, expected in (("<mujoco/>", "no actuator with MuJoCo's muscle gain"), ("<a/>", "no MuJoCo model")):
        path.write_text(text)
        with pytest.raises(ParameterError, match=expected):
            find(str(path), WHERE)


def test_equalities_of_a_mujoco_model_hold_as_mujoco_sees_them(tmp_path: Path):
    osim, xml = tmp_path / "plain.osim", tmp_path / "plain.xml"
    osim.write_text(wrapless.opensim_text())
    wrapless.write_mujoco(xml, osim)
    equality = '<equality><joint joint1="r_elbow" joint2="r_shoulder" polycoef="0.6 0.5 -0.2 0.1 0"/></equality>'
    xml.write_text(xml.read_text().replace("<tendon>", f"{equality}<tendon>"))
    model = MujocoArm(xml)
    assert [one.name for one in model.coordinates] == ["r_shoulder"]
    engine = mujoco.MjModel.from_xml_path(str(xml))
    data = mujoco.MjData(engine)
    for angle in (-0.5, 0.4, 1.3):
        model.put({"r_shoulder": angle})
        R_upper_arm, R_forearm = model.frame("r_humerus")[0], model.frame("r_ulna_radius_hand")[0]
        data.qpos[:] = angle, np.linalg.norm(Rotation.from_matrix(R_upper_arm.T @ R_forearm).as_rotvec())
        mujoco.mj_forward(engine, data)
        (violated,) = data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
        assert violated == pytest.approx(0.0, abs=1e-9)


def test_the_command_says_what_was_mended_and_writes_the_file(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
):
    run(FILE, tmp_path / "arm26.json")
    assert "is used without repairs" in caplog.text
    printed = capsys.readouterr().out
    assert "Its credits: The OpenSim Development Team" in printed and "| BICshort | 436 |" in printed
    assert "against OpenSim's tool on a motion of 1 s" in printed
    assert replace(load(tmp_path / "arm26.json"), certificate=None) == arm26_anatomy()
    with pytest.raises(HricError, match="no file"):
        run(tmp_path / "none.osim", tmp_path / "none.json")


def test_what_a_mujoco_model_includes_is_part_of_its_fit(tmp_path: Path):
    (tmp_path / "a.xml").write_text('<mujoco><include file="b.xml"/></mujoco>')
    (tmp_path / "b.xml").write_text("<mujocoinclude/>")
    before = content(tmp_path / "a.xml")
    (tmp_path / "b.xml").write_text("<mujocoinclude><!--other--></mujocoinclude>")
    assert content(tmp_path / "a.xml") != before


def test_a_model_with_muscles_on_function_based_paths_is_refused(tmp_path: Path):
    human = body(parts="right_arm")
    path = tmp_path / "human.osim"
    urdf_to_osim.write(urdf_to_osim.convert(human.urdf, urdf_to_osim.Options(meshes=False)), path)
    path.write_text(with_muscles(path.read_text(), MuscleSet(human, arm26_anatomy())))
    with pytest.raises(ParameterError, match="has no muscles with points on bodies: right_TRIlong"):
        find(str(path), WHERE)


@pytest.mark.parametrize("chosen", ["delt", "nothing.osim", "model.urdf", "package://hric_human/none.json"])
def test_what_is_no_file_of_an_anatomy_is_refused(chosen: str):
    with pytest.raises(ParameterError, match="alid: delft"):
        find(chosen, WHERE)


def test_muscles_of_a_users_model_have_the_same_moment_arms_in_human_osim(tmp_path: Path):
    human = body(parts="right_arm")
    ours = MuscleSet(human, arm26_anatomy())
    path = tmp_path / "human.osim"
    urdf_to_osim.write(urdf_to_osim.convert(human.urdf, urdf_to_osim.Options(meshes=False)), path)
    path.write_text(with_muscles(path.read_text(), ours))
    model = opensim.Model(str(path))
    state = model.initSystem()
    coordinates = [model.getCoordinateSet().get(name) for name in human.joints]
    for values in poses(arm26_anatomy(), 20):
        q = np.zeros(7)
        q[[0, 3]] = values
        for coordinate, angle in zip(coordinates, q, strict=True):
            coordinate.setValue(state, float(angle), False)
        model.realizePosition(state)
        mine = ours.at(q.tolist(), [0.0] * 7)
        for k in range(ours.muscle_count):
            path_of = opensim.Muscle.safeDownCast(model.getForceSet().get(ours.names[k])).getPath()
            for column, joint in enumerate(ours.joints):
                if mine.arms[k, column]:
                    theirs = path_of.computeMomentArm(state, coordinates[joint])
                    assert theirs == pytest.approx(mine.arms[k, column], abs=1e-9)


def test_a_model_that_no_range_of_an_arm_fits_is_refused(tmp_path: Path):
    path = tmp_path / "x.osim"
    path.write_text(FILE.read_text().replace("2.2689280300000001", "0.01"))
    with pytest.raises(HricError, match="r_elbow_flex does not reach el_flex from 5 to 130 deg"):
        find(str(path), WHERE)
