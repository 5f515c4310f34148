"""hric check_model: CSV files, bags and run folders as input; output, files and errors; use of the fitted friction."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import simulated_arm_log as simulated
import yaml
from sensor_msgs.msg import JointState
from simulated_arm_log import FRICTION, sigmoid

import panda_description
from franka_hw_interface.friction_file import read_friction
from franka_msgs.msg import FrankaState
from hric_core.command import main
from hric_core.errors import HricError
from hric_core.robot_time.stamps import to_time
from hric_experiments.check_model import csv_log
from hric_run.bag_writer import BagWriter
from hric_run.definition import experiment, overrides, parameters
from hric_run.definition.experiment import package_path

NAMES = [f"panda_joint{i}" for i in range(1, 8)]
USUAL = {"t": "t", **{f"{name}{i}": f"{name}{i}" for name in ("q", "dq", "tau") for i in range(1, 8)}}
PNG = b"\x89PNG"
TEXT = "--no-figures"


@pytest.fixture(scope="module")
def data() -> simulated.Simulated:
    """Return every tenth sample of a simulation: 100 Hz, for files that are quick to read."""
    made = simulated.simulate(panda_description.load(meshes=False, collision=False), 8.0)
    return simulated.Simulated(*(values[::10] for values in (made.time, made.q, made.dq, made.tau)))


def columns(data: simulated.Simulated) -> dict[str, np.ndarray]:
    arrays = {"q": data.q, "dq": data.dq, "tau": data.tau}
    return {"t": data.time, **{f"{name}{i + 1}": values[:, i] for name, values in arrays.items() for i in range(7)}}


def write_csv(
    path: Path,
    values: Mapping[str, np.ndarray],
    names: Mapping[str, str] = USUAL,
    delimiter: str = ",",
    order: Sequence[str] = (),
    head: str = "",
) -> Path:
    keys = list(order or values)
    lines = [delimiter.join(names.get(key, key) for key in keys)]
    lines += [
        delimiter.join(repr(float(value)) for value in row) for row in zip(*(values[key] for key in keys), strict=True)
    ]
    path.write_text(head + "\n".join(lines) + "\n")
    return path


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = main(["check_model", *map(str, arguments)])
    printed = capsys.readouterr()
    return code, printed.out, printed.err


def test_a_log_is_compared_drawn_and_its_friction_fitted_and_read_back(data, tmp_path: Path, capsys) -> None:
    path = write_csv(tmp_path / "arm.csv", columns(data))
    fitted = tmp_path / "new" / "own.yaml"
    code, out, err = called(capsys, path, "--friction", "none", "--fit", "friction", "-o", fitted)
    assert (code, err) == (0, "")
    for told in (
        "cut-off 10 Hz",
        "0.3 s dropped at each end",
        "inertials barycentric, with hand; friction none",
        "sum 1.7 N m",
        "real arm",
    ):
        assert told in out
    assert all(out.count(f"\n{name}  ") == 2 for name in NAMES)
    folder = tmp_path / "arm_check_model"
    drawn = [f"{name}.{kind}" for name in ("friction", "residuals", "torques") for kind in ("png", "svg")]
    assert {file.name for file in folder.iterdir()} == {*drawn, "captions.md", "summary.txt"}
    assert all(file.read_bytes().startswith(PNG) for file in folder.glob("*.png"))
    assert (folder / "summary.txt").read_text().strip() in out
    for phi, truth in zip(read_friction(fitted), FRICTION, strict=True):
        velocity = np.linspace(-0.4, 0.4, 100)
        assert (
            np.abs(sigmoid(velocity, np.array(phi)) - sigmoid(velocity, truth)).max()
            < 0.05 * np.abs(sigmoid(velocity, truth)).max()
        )
    again = called(capsys, path, "--friction", fitted, "--out", tmp_path / "again")[1]
    assert "friction of own.yaml" in again and total(again) < 0.1 * total(out)
    assert (tmp_path / "again" / "friction.png").is_file()


def total(printed: str) -> float:
    """Return the sum of the RMS of the residuals [N m]."""
    return float(next(line for line in printed.splitlines() if line.startswith("sum")).split()[1])


def renamed(q: str, dq: str, tau: str, t: str = "t", first: int = 1) -> dict[str, str]:
    """Return names of columns; {}: number of the joint, from `first`."""
    patterns = {"q": q, "dq": dq, "tau": tau}
    return {
        "t": t,
        **{f"{name}{i + 1}": pattern.format(i + first) for name, pattern in patterns.items() for i in range(7)},
    }


EXPORT = '# topic: "/control_log"\n# unit of time: s\n'
GIVEN = ("t=when", "q=angle{}", "dq=rate{}", "tau=load1,load2,load3,load4,load5,load6,load7")
KINDS = {
    "another order": (USUAL, ",", "", ()),
    "spaces, and a comment for a header": (renamed("q{}", "dq{}", "tau{}", "# t"), " ", "", ()),
    "semicolons, capitals, underscores": (renamed("Q_{}", "DQ_{}", "Tau_J_{}", "Time"), ";", "", ()),
    "counted from 0 in brackets": (renamed("q[{}]", "dq[{}]", "tau[{}]", first=0), ",", "", ()),
    "an export of this project": (
        renamed("position.panda_joint{}", "velocity.panda_joint{}", "effort.panda_joint{}", "time"),
        ",",
        EXPORT,
        (),
    ),
    "rostopic echo -p": (renamed("field.q{}", "field.dq{}", "field.tau_J{}", "%time", first=0), ",", "", ()),
    "names that are given": (renamed("angle{}", "rate{}", "load{}", "when"), "\t", "", GIVEN),
}


@pytest.mark.parametrize("kind", KINDS)
def test_columns_are_found_in_any_order_under_usual_and_given_names(data, tmp_path: Path, kind: str) -> None:
    names, delimiter, head, given = KINDS[kind]
    values = columns(data)
    keys = list(values) if "# t" in names.values() else list(np.random.default_rng(3).permutation([*values, "else"]))
    path = write_csv(tmp_path / "arm.csv", values | {"else": data.time}, {**USUAL, **names}, delimiter, keys, head)
    log = csv_log.read_csv(path, NAMES, csv_log.parse_columns(given))
    for found, truth in ((log.time, data.time), (log.q, data.q), (log.dq, data.dq), (log.tau, data.tau)):
        assert np.array_equal(found, truth)
    assert log.joint_names == tuple(NAMES)


def edited(change: Callable[[dict[str, np.ndarray]], None]) -> Callable[[Path, simulated.Simulated], Path]:
    def write(path: Path, data: simulated.Simulated) -> Path:
        values = {name: column.copy() for name, column in columns(data).items()}
        change(values)
        return write_csv(path, values)

    return write


def replaced(old: str, new: str) -> Callable[[Path, simulated.Simulated], Path]:
    def write(path: Path, data: simulated.Simulated) -> Path:
        write_csv(path, columns(data))
        path.write_text(path.read_text().replace(old, new, 1))
        return path

    return write


def put(name: str, k: int, value: float) -> Callable[[dict[str, np.ndarray]], None]:
    return lambda values: values[name].__setitem__(k, value)


def every(change: Callable[[str, np.ndarray], np.ndarray]) -> Callable[[dict[str, np.ndarray]], None]:
    return lambda values: values.update({name: change(name, column) for name, column in values.items()})


def whole(content: bytes) -> Callable[[Path, simulated.Simulated], Path]:
    def write(path: Path, data: simulated.Simulated) -> Path:
        path.write_bytes(content)
        return path

    return write


HEADER, ZEROS = ",".join(USUAL).encode() + b"\n", b",".join([b"0"] * 22) + b"\n"
REFUSED = {
    "NaN": (edited(put("q3", 4, np.nan)), "line 6, column q3 is nan; each value must be finite"),
    "infinite": (edited(put("tau7", 0, np.inf)), "line 2, column tau7 is inf"),
    "degrees": (
        edited(every(lambda name, column: np.rad2deg(column) if "q" in name else column)),
        "the positions look like degrees",
    ),
    "milliseconds": (
        edited(every(lambda name, column: 1e3 * column if name == "t" else column)),
        "the time looks like milliseconds",
    ),
    "millinewton metres": (
        edited(every(lambda name, column: 1e3 * column if "tau" in name else column)),
        "times what the motion needs",
    ),
    "too short": (edited(every(lambda name, column: column[:200])), "the log is too short: 1.99 s; 2.6 s are needed"),
    "time back": (edited(put("t", 7, 0.02)), "time does not increase: t is 0.02 in line 9 after 0.06 in line 8"),
    "missing columns": (
        replaced("tau4", "load4"),
        "has no columns tau1 to tau7 for the measured joint torques [N m]; columns in the file: t, q1, q2",
    ),
    "missing time": (replaced("t,q1", "x,q1"), "has no columns t for the time [s]; columns in the file: x, q1"),
    "a missing velocity": (replaced("dq1,dq2", "dq1,q2"), "columns dq1 to dq7 for the joint velocities"),
    "text": (replaced("0.01,", "soon,"), "line 3, column t is 'soon'; each value must be a number"),
    "a short line": (whole(HEADER + ZEROS + b"0,0,0\n"), "line 3, column q3 is missing"),
    "no header": (whole(ZEROS), "has no header; its first line must name the columns, usually t, q1 to q7"),
    "empty": (whole(b""), "has no header"),
    "header alone": (whole(HEADER), "a header, but no samples"),
    "binary": (whole(b"\xff\xfe\x00"), "it is not a text file"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_compared_is_refused_in_one_line_and_nothing_is_written(
    data, tmp_path: Path, capsys, kind: str
) -> None:
    write, said = REFUSED[kind]
    code, out, err = called(capsys, write(tmp_path / "arm.csv", data))
    assert (code, out, err.count("\n")) == (2, "", 1) and err.startswith("hric check_model: ")
    assert said in err
    assert [file.name for file in tmp_path.iterdir()] == ["arm.csv"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--columns", "qq=a"), "cannot read 'qq=a' of --columns; valid: t=NAME"),
        (("--columns", "q=a,b"), "--columns has 2 columns in 'a,b'; valid: 7"),
        (("--columns", "q=angle{}"), "has no column angle1, angle2, angle3"),
        (("--topic", "/joint_states"), "--topic selects a topic of a bag; valid for a CSV file: --columns"),
        (("--friction", "dry"), "--friction dry: no such file; valid: none, identified, or a YAML file"),
        (("--load", "1"), "--load has 1 values; valid: 4 (mass x y z) or 10"),
        (("--load", "-1", "0", "0", "0"), "load mass must not be negative"),
        (("-o", "x.yaml"), "-o is the file for the fitted friction; valid: -o only together with --fit friction"),
        (("--urdf", "x.urdf", "--no-hand"), "--urdf already defines inertials and hand"),
        (("--urdf", "nowhere.urdf"), "cannot read nowhere.urdf: No such file"),
        (("--cutoff", "30"), "a cut-off of 30 Hz needs 150 or more"),
    ],
)
def test_a_wrong_argument_is_refused_with_what_would_be_right(
    data, tmp_path: Path, capsys, arguments: tuple[str, ...], said: str
) -> None:
    path = write_csv(tmp_path / "arm.csv", columns(data))
    code, out, err = called(capsys, path, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1) and said in err
    assert called(capsys, tmp_path / "nothing.csv")[2].endswith("nothing.csv: No such file or directory\n")


def test_hand_load_and_inertial_set_belong_to_the_model(data, tmp_path: Path, capsys) -> None:
    path = write_csv(tmp_path / "arm.csv", columns(data))
    out = called(capsys, path, "--friction", "none", TEXT)[1]
    for option, told in (
        (("--no-hand",), "without hand"),
        (("--load", 1, 0, "-1e-3", 0.1, 0.01, 0, 0, 0.01, 0, 0.01), "load 1 kg at 0 -0.001 0.1 m"),
    ):
        other = called(capsys, path, "--friction", "none", TEXT, *option)[1]
        assert told in other and total(other) > total(out) + 0.2
    thesis = called(capsys, path, "--friction", "none", TEXT, "--inertials", "thesis")[1]
    assert "inertials thesis" in thesis and total(thesis) > total(
        out
    )  # the sets differ in inertia alone, and the motion is slow


def without_hand(data: simulated.Simulated) -> simulated.Simulated:
    """Return the log of the same motion of an arm without a hand."""
    ddq = np.gradient(data.dq, data.time, axis=0)
    needed = []
    for hand in (True, False):
        model = pinocchio.buildModelFromXML(panda_description.load(hand=hand, meshes=False, collision=False))
        rest, work = np.zeros(model.nq - 7), model.createData()
        rows = [[np.concatenate([part, rest]) for part in row] for row in zip(data.q, data.dq, ddq, strict=True)]
        needed.append(np.array([pinocchio.rnea(model, work, *row)[:7] for row in rows]))
    return simulated.Simulated(data.time, data.q, data.dq, data.tau - needed[0] + needed[1])


def test_whether_the_arm_had_a_hand_is_tried_where_nobody_says(data, tmp_path: Path, capsys) -> None:
    bare = write_csv(tmp_path / "bare.csv", columns(without_hand(data)))
    out = called(capsys, bare, TEXT)[1]
    assert "without hand" in out and "neither --hand nor --no-hand is given: the sum of the residuals is" in out
    wrong = called(capsys, bare, TEXT, "--hand")[1]
    assert (
        "with hand" in wrong
        and "neither --hand nor --no-hand is given" not in wrong
        and total(wrong) > 2.0 * total(out)
    )
    right = called(capsys, write_csv(tmp_path / "arm.csv", columns(data)), TEXT)[1]
    assert "with hand" in right and total(right) == pytest.approx(total(out), rel=0.05)


def joint_state(
    names: Sequence[str], position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, stamp: float
) -> JointState:
    message = JointState(
        name=list(names), position=position.tolist(), velocity=velocity.tolist(), effort=effort.tolist()
    )
    message.header.stamp = to_time(stamp)
    return message


def write_joint_states(path: Path, data: simulated.Simulated, names: Sequence[str]) -> Path:
    """Write joint states of the arm in reverse order of joints, alternating with those of a gripper on this topic."""
    fingers = np.zeros(2)
    with BagWriter(path) as bag:
        for t, q, dq, tau in zip(data.time, data.q, data.dq, data.tau, strict=True):
            bag.write("/joint_states", joint_state(names[::-1], q[::-1], dq[::-1], tau[::-1], t + 1.0), t + 1.0)
            bag.write(
                "/joint_states", joint_state(["finger1", "finger2"], fingers, fingers, fingers, t + 1.004), t + 1.004
            )
    return path


def write_franka_states(path: Path, data: simulated.Simulated, *arms: str) -> Path:
    with BagWriter(path) as bag:
        for t, q, dq, tau in zip(data.time, data.q, data.dq, data.tau, strict=True):
            state = FrankaState(q=q.tolist(), dq=dq.tolist(), tau_J=tau.tolist())
            state.header.stamp = to_time(t + 1.0)
            for arm in arms or [""]:
                bag.write(f"{arm}/franka_state_controller/franka_states", state, t + 1.0)
    return path


def test_bags_with_joint_states_and_with_franka_states_give_what_the_csv_gives(data, tmp_path: Path, capsys) -> None:
    known = total(called(capsys, write_csv(tmp_path / "arm.csv", columns(data)), TEXT)[1])
    for path in (
        write_joint_states(tmp_path / "joints.bag", data, NAMES),
        write_franka_states(tmp_path / "franka.bag", data),
    ):
        code, out, err = called(capsys, path, TEXT)
        assert (code, err) == (0, "") and "800 samples" in out
        assert total(out) == pytest.approx(known, abs=0.002)
        assert [file.name for file in (tmp_path / f"{path.stem}_check_model").iterdir()] == ["summary.txt"]


def test_joints_and_topics_that_a_bag_does_not_have_are_refused_with_those_it_has(data, tmp_path: Path, capsys) -> None:
    few = simulated.Simulated(*(values[:3] for values in (data.time, data.q, data.dq, data.tau)))
    path = write_joint_states(tmp_path / "other.bag", few, [f"a{i}" for i in range(1, 8)])
    code, _, err = called(capsys, path)
    assert (
        code == 2
        and "no joints <arm>_joint1 to 7 with position, velocity and effort; joints in the bag: a1, a2, a3" in err
    )
    path = write_joint_states(tmp_path / "panda.bag", few, NAMES)
    assert "no joints left_joint1 to 7" in called(capsys, path, "--arm-id", "left")[2]
    assert "no topic with joints '/x' in panda.bag; valid: /joint_states" in called(capsys, path, "--topic", "/x")[2]
    assert "--columns selects columns of a CSV file" in called(capsys, path, "--columns", "t=x")[2]


def test_the_states_of_one_of_two_arms_are_chosen_by_their_topic(data, tmp_path: Path, capsys) -> None:
    path = write_franka_states(tmp_path / "arms.bag", data, "/left", "/right")
    code, _, err = called(capsys, path, "--arm-id", "right")
    assert code == 2 and "on /left/franka_state_controller/franka_states, /right/franka_state" in err
    chosen = called(capsys, path, "--arm-id", "right", "--topic", "/right/franka_state_controller/franka_states", TEXT)
    assert chosen[0] == 0 and "800 samples" in chosen[1]


def test_a_nan_in_a_bag_is_refused_with_its_message_and_field(data, tmp_path: Path, capsys) -> None:
    tau = data.tau.copy()
    tau[5, 1] = np.nan
    path = write_joint_states(tmp_path / "nan.bag", simulated.Simulated(data.time, data.q, data.dq, tau), NAMES)
    assert "message 11, column effort.panda_joint2 is nan; each value must be finite" in called(capsys, path)[2]


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a friction file as a fit does: known friction with joint names of another arm, and comments."""
    lines = [
        f"fr3_joint{i + 1}: {{phi1: {a}, phi2: {b}, phi3: {c}}}  # fitted"
        for i, (a, b, c) in enumerate(FRICTION.tolist())
    ]
    path = tmp_path_factory.mktemp("friction") / "friction.yaml"
    path.write_text("\n".join(["# Joint friction", *lines]))
    return path


def test_a_simulated_run_with_fitted_friction_leaves_a_small_residual(fitted: Path, tmp_path: Path, capsys) -> None:
    run = ["run", "pd_step", f"friction:={fitted}", "arm_id:=left", "--runs", str(tmp_path), "--quiet", "--no-figures"]
    assert main(run) == 0
    capsys.readouterr()
    code, out, _ = called(capsys, "latest", "--runs", tmp_path)
    assert code == 0 and "/control_log" in out and "friction identified, as in the simulation" in out
    assert total(out) < 0.02
    assert (tmp_path / "latest" / "check_model" / "torques.png").is_file()
    for option in (("--friction", "none"), ("--friction", "identified")):
        assert total(called(capsys, "latest", "--runs", tmp_path, TEXT, *option)[1]) > 0.2
    same = called(capsys, "latest", "--runs", tmp_path, TEXT, "--inertials", "barycentric")[1]
    assert "without hand" in same and total(same) == pytest.approx(total(out), abs=0.002)


def test_the_file_of_a_fit_is_what_the_pybullet_plant_takes(data, tmp_path: Path, capsys) -> None:
    from pybullet_ros_control.plant import PyBulletPlant

    path = tmp_path / "fit.yaml"
    assert called(capsys, write_csv(tmp_path / "arm.csv", columns(data)), "--fit", "friction", "-o", path, TEXT)[0] == 0
    friction = {"friction": "identified", "friction_parameters": yaml.safe_load(path.read_text())}
    other = {"gravity": [0.0, 0.0, 0.0], "rotor_inertia": 0.0, "collision": False}
    plant = PyBulletPlant(panda_description.load(meshes=False, collision=False), NAMES, {**friction, **other})
    plant.reset(simulated.MIDDLE.tolist())
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    for _ in range(400):
        plant.apply([0.0] * 6 + [0.1])
        plant.step()
    plant.read_state(q, dq, tau)
    plant.close()
    # The last joint has come to the speed at which its friction is the torque that drives it.
    assert sigmoid(np.array(dq[6]), FRICTION[6]) == pytest.approx(0.1, rel=0.05)


def test_a_friction_file_reaches_the_plant_under_the_arms_own_joint_names(fitted: Path) -> None:
    for arm_id, plain in (("panda", []), ("left", ["arm_id:=left"])):
        run = experiment.load("pd_step", [f"friction:={fitted}", *plain])
        plant = parameters.robot(run)["plant"]
        assert plant["friction"] == "identified"
        assert list(plant["friction_parameters"]) == [f"{arm_id}_joint{i}" for i in range(1, 8)]
        assert [list(phi.values()) for phi in plant["friction_parameters"].values()] == FRICTION.tolist()
    assert (
        parameters.robot(experiment.load("pd_step", ["friction:=identified"]))["plant"]["friction_parameters"]
        == panda_description.friction_parameters()
    )


def test_a_friction_file_that_is_not_there_is_refused_by_run(tmp_path: Path) -> None:
    with pytest.raises(HricError, match=r"nowhere.yaml cannot be read: .*No such file"):
        overrides.apply(experiment.read("pd_step"), [f"friction:={tmp_path / 'nowhere.yaml'}"])


def test_the_trajectory_that_the_readme_names_shows_all_friction_within_a_third_of_the_limits_and_without_contact() -> (
    None
):
    from pybullet_ros_control.plant import PyBulletPlant

    message = yaml.safe_load((package_path("hric_bringup") / "config" / "excitation.yaml").read_text())
    assert message["joint_names"] == NAMES
    poses = np.array([point["positions"] for point in message["points"]])
    times = np.array([float(point["time_from_start"]["secs"]) for point in message["points"]])
    move, duration = np.diff(poses, axis=0), np.diff(times)[:, None]
    # From rest to rest by a cubic, as the controller goes.
    velocity, acceleration = 1.5 * np.abs(move) / duration, 6.0 * np.abs(move) / duration**2
    limits = panda_description.joint_limits().values()
    assert (velocity.max(axis=0) < [limit.velocity / 2.5 for limit in limits]).all() and (
        velocity.max(axis=0) > 0.4
    ).all()
    assert (acceleration.max(axis=0) < [limit.acceleration / 3.0 for limit in limits]).all()
    assert ((poses > [limit.lower for limit in limits]) & (poses < [limit.upper for limit in limits])).all()
    plant = PyBulletPlant(panda_description.load(meshes=False), NAMES, {"gravity": [0.0, 0.0, 0.0]})
    for start, way in zip(poses, move, strict=False):
        for s in np.linspace(0.0, 1.0, 25):
            plant.reset((start + (3.0 * s**2 - 2.0 * s**3) * way).tolist())
            plant.step()
            assert not plant.contacts()
    plant.reset([0.0, 0.5, 0.0, -3.07, 0.0, 0.5, 0.0])
    plant.step()
    assert plant.contacts()  # of a folded arm there would be some
    plant.close()
