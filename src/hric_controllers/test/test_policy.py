"""The policy controller on the simulated arm: motion, delay, goals, outputs that are not finite, files."""

import json
import subprocess
import sys

import numpy as np
import pytest
from arm_rig import ArmRig
from geometry_msgs.msg import Point, PointStamped

onnx = pytest.importorskip("onnx", reason="scripts/setup --with learning")
pytest.importorskip("onnxruntime", reason="scripts/setup --with learning")

import panda_description  # noqa: E402
from hric_controllers.cartesian.workspace import Box  # noqa: E402
from hric_controllers.policy import network  # noqa: E402
from hric_controllers.policy.contract import KEY, FieldScale, PolicyContract, PolicyRobot  # noqa: E402
from hric_core.errors import HricError  # noqa: E402

NAME, FAR = "policy_controller", [0.3, 0.4, 0.3]
FIELDS = (
    FieldScale("q", "rad", [0.0] * 7, [1.0] * 7),
    FieldScale("goal_offset", "m", [0.0] * 3, [0.5] * 3),
)
LIMITS = panda_description.joint_limits()
ROBOT = PolicyRobot(
    "panda",
    [f"joint{number}" for number in range(1, 8)],
    *([getattr(limit, end) for limit in LIMITS.values()] for end in ("lower", "upper")),
    [0.3075, 0.27015, 0.56283],  # as in the committed policy
)
CONTRACT = json.loads(
    PolicyContract(1, FIELDS, 0.04, "end_effector_stream", 0.5, 0.03, ROBOT, Box([-3.0] * 3, [3.0] * 3)).text()
)


def write(path, bias, weight=None, metadata=CONTRACT, size=10):
    """Write a network with one layer: action = weight observation + bias."""
    weight = np.zeros((3, size)) if weight is None else weight
    arrays = [("weight", weight), ("bias", bias)]
    values = [onnx.numpy_helper.from_array(np.asarray(array, np.float32), name) for name, array in arrays]
    ends = [
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, count])
        for name, count in (("observation", size), ("action", 3))
    ]
    node = onnx.helper.make_node("Gemm", ["observation", "weight", "bias"], ["action"], transB=1)
    graph = onnx.helper.make_graph([node], "policy", ends[:1], ends[1:], values)
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    if metadata is not None:
        onnx.helper.set_model_props(model, {KEY: json.dumps(metadata)})
    onnx.save(model, str(path))
    return str(path)


def driven(path, seconds=1.0, **changes):
    """Return the rig after a run, and the desired joint positions of each cycle, shape (n, 7)."""
    bench, rows = ArmRig(NAME, file=path, **changes), []
    bench.run(seconds, lambda _: rows.append(list(bench.state.q_d)))
    return bench, np.array(rows)


@pytest.fixture
def sideways(tmp_path):
    """Policy that moves the end effector along y at 0.2 m/s."""
    return write(tmp_path / "sideways.onnx", [0, 0.4, 0])


def test_actions_move_the_end_effector_at_their_velocity_within_the_limits(sideways):
    bench, q = driven(sideways, 0.6, goal=FAR)
    before = np.array(bench.state.O_T_EE[12:15])
    bench.run(0.5)
    assert bench.hw.error == ""
    speed = (np.array(bench.state.O_T_EE[12:15]) - before) / 0.5
    assert speed == pytest.approx([0.0, 0.2, 0.0], abs=5e-3)
    rates = [np.abs(np.diff(q, order, axis=0)).max() * 1e3**order for order in (1, 2, 3)]
    assert np.all(np.array(rates) <= 1.001 * np.array([1.5, 7.0, 500.0]))


def test_the_joints_stay_within_their_ranges_and_below_their_velocity_where_the_arm_ends(tmp_path):
    box = {"lower": [-3.0] * 3, "upper": [3.0] * 3}
    bench, q = driven(write(tmp_path / "up.onnx", [1, 0, 1]), 6.0, goal=[2.0, 0.0, 2.0], workspace=box)
    assert bench.hw.error == "" and np.abs(np.diff(q, axis=0)).max() <= 1.501e-3
    assert bench.state.O_T_EE[14] > 0.6


def test_the_policy_cannot_leave_the_workspace_and_no_goal_is_outside(tmp_path):
    down = write(tmp_path / "down.onnx", [0.2, 0, -1])
    bench, _ = driven(down, 3.0, goal=FAR, workspace={"lower": [-0.85, -0.85, 0.25], "upper": [0.85, 0.85, 1.2]})
    assert bench.hw.error == "" and bench.state.O_T_EE_c[14] == pytest.approx(0.25, abs=0.005)
    with pytest.raises(HricError, match=r"goal is .*; valid: a point in the workspace, x -0.85 to 0.85, .*z 0.02 to"):
        ArmRig(NAME, file=down, goal=[0.4, 0.0, -0.3])


def test_without_a_goal_the_arm_rests(sideways):
    _, q = driven(sideways, 0.3)
    assert np.ptp(q, axis=0).max() == 0.0


def test_near_the_goal_the_arm_comes_to_rest_there_without_the_policy(sideways):
    goal = [x + 0.01 for x in ArmRig(NAME, file=sideways).state.O_T_EE[12:15]]
    bench, q = driven(sideways, 1.0, goal=goal)
    assert bench.state.O_T_EE[12:15] == pytest.approx(goal, abs=1e-3)
    assert np.ptp(q[-200:], axis=0).max() < 1e-6


def test_a_goal_that_is_passed_at_full_speed_is_where_the_arm_comes_to_rest(tmp_path):
    """The policy moves along y only, at 0.5 m/s, and would go on behind the goal."""
    path = write(tmp_path / "fast.onnx", [0, 1, 0])
    x, y, z = ArmRig(NAME, file=path).state.O_T_EE[12:15]
    bench, _ = driven(path, 2.5, goal=[x, y + 0.3, z])
    assert bench.hw.error == "" and bench.state.O_T_EE[12:15] == pytest.approx([x, y + 0.3, z], abs=1e-3)


def test_a_goal_of_the_topic_starts_the_policy_and_a_wrong_one_is_refused(sideways):
    def send(x, frame):
        message = PointStamped()
        message.header.frame_id, message.point = frame, Point(x, 0.4, 0.3)
        bench.publish("goal", message)

    bench, q = driven(sideways, 0.2)
    assert np.ptp(q, axis=0).max() == 0.0
    bench.node.raises = True
    for x, frame in ((np.nan, ""), (0.3, "world"), (300.0, "")):
        with pytest.raises(HricError, match="valid: finite numbers, in panda_link0"):
            send(x, frame)
    bench.run(0.2)
    assert bench.state.q_d == pytest.approx(q[-1])
    send(0.3, "panda_link0")
    bench.run(0.5)
    assert bench.state.q_d[0] - q[-1, 0] > 0.05


def test_a_delay_shifts_the_motion_by_its_cycles_and_gives_the_same_bits_each_time(tmp_path):
    path = write(tmp_path / "constant.onnx", [0.2, 0, -0.3])
    _, at_once = driven(path, 0.8, goal=FAR)
    first, second = (driven(path, 0.8, goal=FAR, delay=7)[1] for _ in range(2))
    assert np.array_equal(first, second)
    assert first[7:] == pytest.approx(at_once[:-7], abs=1e-4) and not np.array_equal(first, at_once)


def test_the_network_gets_the_scaled_fields_in_their_order(tmp_path):
    """The velocity along y is the scaled offset of the goal along y, in the last but one place of the observation."""
    weight = np.zeros((3, 10))
    weight[1, 8] = 1.0
    bench = ArmRig(NAME, file=write(tmp_path / "offset.onnx", np.zeros(3), weight))
    start = np.array(bench.run(0.1).state.O_T_EE[12:15])
    message = PointStamped()
    target = start + np.array([0.0, 0.2, 0.0])
    message.point.x, message.point.y, message.point.z = target
    bench.publish("goal", message)
    bench.run(0.5)
    first = bench.state.O_T_EE[13] - start[1]
    bench.run(5.0)
    assert 0.02 < first < 0.1  # at most 0.5 m/s times 0.2 m / 0.5 m
    assert bench.state.O_T_EE[12:15] == pytest.approx(target, abs=1e-3)


def test_an_output_that_is_not_finite_brings_the_arm_to_rest_and_ends_the_controller(tmp_path):
    """The output is beyond the numbers of 32 bits, thus infinite, when the first joint has turned by 0.11 rad."""
    weight = np.zeros((3, 10))
    weight[1, 0] = 3e38
    scale = {**CONTRACT["fields"][0], "scale": [0.1] * 7}
    metadata = CONTRACT | {"fields": [scale, CONTRACT["fields"][1]]}
    path = write(tmp_path / "diverging.onnx", [0, 0.4, 0], weight, metadata)
    bench, q = driven(path, 1.5, goal=FAR)
    assert q[-1, 0] > 0.1 and bench.hw.error == "" and np.abs(q[-1] - q[-300]).max() < 1e-9
    (item,) = bench.manager.list()
    assert item.state == "aborted" and "is not finite; the arm was stopped" in item.error


@pytest.mark.parametrize("delay", [0, 5])
def test_a_network_that_fails_in_the_motion_brings_the_arm_to_rest_and_ends_the_controller(tmp_path, delay):
    """An index of the network is out of its range when the first joint has turned by 0.1 rad."""
    path = write(tmp_path / "failing.onnx", [0, 0.4, 0])
    model = onnx.load(path)
    model.graph.node[0].output[0] = "moves"
    pick, zero = (np.eye(10, 1, dtype=np.float32) * 10, np.zeros(1, np.float32))
    model.graph.initializer.extend(onnx.numpy_helper.from_array(a, n) for a, n in ((pick, "pick"), (zero, "zero")))
    made = onnx.helper.make_node
    model.graph.node.extend(
        [
            made("MatMul", ["observation", "pick"], ["turned"]),
            made("Cast", ["turned"], ["index"], to=onnx.TensorProto.INT64),
            made("Gather", ["zero", "index"], ["nothing"]),
            made("Add", ["moves", "nothing"], ["action"]),
        ]
    )
    onnx.save(model, path)
    bench, q = driven(path, 1.5, goal=FAR, delay=delay)
    assert q[-1, 0] > 0.1 and bench.hw.error == "" and np.abs(q[-1] - q[-300]).max() < 1e-9
    (item,) = bench.manager.list()
    assert item.state == "aborted" and "failing.onnx cannot be executed" in item.error


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda graph: graph.input[0].type.tensor_type.shape.dim[0].__setattr__("dim_value", 2), "cannot be executed"),
        (lambda graph: graph.input[0].type.tensor_type.__setattr__("elem_type", 11), "is not an ONNX file"),
        (lambda graph: graph.node[0].input.__setitem__(0, "absent"), "is not an ONNX file"),
    ],
)
def test_a_network_that_does_not_take_the_observation_is_refused(tmp_path, change, match, capfd):
    model = onnx.load(write(tmp_path / "policy.onnx", [0.0] * 3))
    change(model.graph)
    onnx.save(model, str(tmp_path / "policy.onnx"))
    with pytest.raises(HricError, match=f"policy.onnx {match}.*; valid: a file by hric train"):
        ArmRig(NAME, file=str(tmp_path / "policy.onnx"))
    assert "onnxruntime" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (None, "its metadata has no hric_policy; valid: a file by hric train"),
        ({"version": 2}, "version is 2; valid: a whole number from 1 to 1"),
        ({"action": "torque"}, "action is 'torque'; valid: end_effector_stream"),
        ({"period": 40.0}, "period is 40.0"),
        ({"speed": 1.0}, "speed"),
        ({"fields": [{"name": "q", "unit": "deg", "offset": [0.0] * 7, "scale": [1.0] * 7}]}, "rad, the unit of q"),
        ({"fields": [{"name": "q", "unit": "rad", "offset": [0.0] * 6, "scale": [1.0] * 7}]}, "7 numbers, as q has"),
        ({"fields": [{"name": "q", "unit": "rad", "offset": [0.0] * 7, "scale": [0.0] * 7}]}, "above 0"),
        ({"fields": CONTRACT["fields"][:1] * 2}, "each field once"),
        ({"fields": CONTRACT["fields"][:1]}, "valid by its contract"),
    ],
)
def test_a_file_whose_contract_does_not_fit_is_refused(tmp_path, change, match):
    metadata = None if change is None else CONTRACT | change
    with pytest.raises(HricError, match=match):
        ArmRig(NAME, file=write(tmp_path / "policy.onnx", [0.0] * 3, metadata=metadata))


@pytest.mark.parametrize(
    ("field", "change", "match"),
    [
        ("joints", lambda x: x[::-1], "joints of panda in the training: joint7, .*, of panda: joint1, "),
        (
            "upper",
            lambda x: [*x[:5], 4.5169, *x[6:]],
            "upper of panda in the training: .*, or other_ranges: true",
        ),
        ("ee_position", lambda x: [*x[:2], x[2] + 0.01], "ee_position of panda in the training: .* 0.5728, of panda: "),
    ],
)
def test_a_policy_of_another_robot_is_refused(tmp_path, field, change, match):
    robot = CONTRACT["robot"]
    metadata = CONTRACT | {"robot": robot | {field: change(robot[field])}}
    path = write(tmp_path / "other.onnx", [0.0] * 3, metadata=metadata)
    with pytest.raises(HricError, match=f"other.onnx: the policy is of another robot: {match}"):
        ArmRig(NAME, file=path)
    if field == "upper":
        ArmRig(NAME, file=path, other_ranges=True)
    else:
        with pytest.raises(HricError, match="another robot"):
            ArmRig(NAME, file=path, other_ranges=True)


def test_another_end_effector_is_refused_at_the_start(sideways):
    bench = ArmRig(NAME, file=sideways, start=False)
    bench.hw.model.set_ee(np.eye(4))
    with pytest.raises(HricError, match=r"sideways.onnx: the policy is of another robot: ee_position"):
        bench.manager.switch([NAME], [])
        bench.run(0.01)


def test_joints_in_another_order_are_refused(sideways):
    with pytest.raises(HricError, match="the policy is of another robot: joints of panda in the training: joint1, "):
        ArmRig(NAME, file=sideways, joints=[f"panda_joint{number}" for number in range(7, 0, -1)])


@pytest.mark.parametrize("missing", ["robot", "goals"])
def test_a_policy_that_does_not_name_its_robot_is_not_known_to_fit(tmp_path, missing):
    metadata = {key: value for key, value in CONTRACT.items() if key != missing}
    with pytest.raises(HricError, match=r"old.onnx: the robot of the policy is not known: .*; valid: .* new training"):
        ArmRig(NAME, file=write(tmp_path / "old.onnx", [0.0] * 3, metadata=metadata))


def test_a_goal_outside_those_of_the_training_is_refused(tmp_path):
    metadata = CONTRACT | {"goals": {"lower": [0.3, -0.4, 0.2], "upper": [0.6, 0.4, 0.6]}}
    path = write(tmp_path / "near.onnx", [0.0] * 3, metadata=metadata)
    with pytest.raises(HricError, match=r"goal is \(0.3, 0.5, 0.3\); valid: a goal of the policy, x 0.3 to 0.6, "):
        ArmRig(NAME, file=path, goal=[0.3, 0.5, 0.3])
    bench = ArmRig(NAME, file=path).run(0.01)
    bench.node.raises = True
    message = PointStamped(point=Point(0.3, 0.5, 0.3))
    with pytest.raises(HricError, match=r"refused; valid: .*y -0.4 to 0.4, .*goals of the policy"):
        bench.publish("goal", message)


def test_what_is_no_policy_is_refused(tmp_path, sideways, monkeypatch):
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(HricError, match="is not an ONNX file"):
        ArmRig(NAME, file=str(tmp_path / "text.onnx"))
    with pytest.raises(HricError, match="no file"):
        ArmRig(NAME, file=str(tmp_path / "absent.onnx"))
    with pytest.raises(HricError, match="delay is 40; valid: less than 40"):
        ArmRig(NAME, file=sideways, delay=40)
    monkeypatch.setattr(network.PolicyNetwork, "_measured", lambda self: 2e-4)
    with pytest.raises(HricError, match=r"a run of .* takes 0.20 ms, more than 10 % of a cycle"):
        ArmRig(NAME, file=sideways)
    ArmRig(NAME, file=sideways, delay=2)


def test_without_onnxruntime_the_error_names_the_command_that_installs_it(sideways):
    lines = (
        "import sys; from pathlib import Path; sys.modules['onnxruntime'] = None\n"
        "from hric_controllers.policy.network import PolicyNetwork\nPolicyNetwork(Path(sys.argv[1]))"
    )
    done = subprocess.run([sys.executable, "-c", lines, sideways], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "scripts/setup --with learning" in done.stderr.splitlines()[-1]
