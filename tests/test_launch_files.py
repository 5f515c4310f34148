"""Launch files, read without a ROS master: started nodes, their parameters, and documentation of every argument."""

import functools
import io
import re
import shlex
import subprocess
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import pytest
import roslaunch.arg_dump
import roslaunch.config
import roslaunch.loader
import yaml
from roslaunch.core import RLException

from hric_core import urdf
from hric_core.command import perform
from hric_core.errors import HricError

PACKAGE, FILE = "hric_bringup", "bringup.launch"


def launch_file() -> str:
    return roslaunch.rlutil.resolve_launch_arguments([PACKAGE, FILE])[0]


@functools.cache
def loaded(*arguments: str) -> roslaunch.config.ROSLaunchConfig:
    """Load bringup.launch with these arguments; the result is cached, since loading takes seconds."""
    return roslaunch.config.load_config_default(
        [(launch_file(), list(arguments))], None, verbose=False, assign_machines=False
    )


def nodes(config: roslaunch.config.ROSLaunchConfig) -> dict[str, str]:
    return {node.namespace + node.name: f"{node.package}/{node.type}" for node in config.nodes}


def parameters(config: roslaunch.config.ROSLaunchConfig) -> dict[str, object]:
    return {name: parameter.value for name, parameter in config.params.items()}


@functools.cache
def described(*words: str) -> str:
    """Return the output of `hric describe`; raise HricError if it fails."""
    with redirect_stdout(io.StringIO()) as printed:
        perform(["describe", *words])
    return printed.getvalue()


@pytest.fixture(autouse=True, scope="module")
def described_here() -> Iterator[None]:
    """Run `hric describe` in this process instead of one process per parameter, which would take minutes.

    If it fails, roslaunch starts the real process and reports its error. Tests in tests/integration always use the
    real process.
    """
    started = roslaunch.loader.Loader.param_value

    def param_value(loader: Any, verbose: bool, name: str, kind: str, *sources: str | None) -> Any:
        words = shlex.split(sources[-1] or "")
        if words and Path(words[0]).name == "describe":
            try:
                return roslaunch.loader.convert_value(described(*words[1:]), kind)
            except HricError:
                pass
        return started(loader, verbose, name, kind, *sources)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(roslaunch.loader.Loader, "param_value", param_value)
        yield


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)


def test_default_nodes() -> None:
    config = loaded("rviz:=false")
    assert nodes(config) == {
        "/robot": "hric_control/robot",
        "/spawner": "hric_experiments/spawn",
        "/robot_state_publisher": "robot_state_publisher/robot_state_publisher",
        "/recorder": "hric_experiments/recorder",
        "/franka_gripper": "franka_sim/franka_gripper",
    }
    values = parameters(config)
    assert values["/use_sim_time"] is True
    assert values["/joint_pd_controller/type"] == "hric_controllers/JointPDController"
    assert "panda_joint7" in str(values["/robot_description"]) and "panda_hand" in str(values["/robot_description"])
    assert values["/robot"]["real_time_factor"] == 1.0
    assert values["/franka_gripper/robot_joint_states"] == "joint_states"
    assert (values["/recorder/start"], values["/robot"]["wait_for_log_listener"]) == ("on_request", 0)
    assert "controllers:=[joint_state_controller,franka_state_controller,joint_pd_controller]" in str(
        values["/spawner/overrides"]
    )


REAL = ("env:=real", "robot_ip:=127.0.0.2")
EVERYWHERE = pytest.mark.parametrize("environment", [(), REAL], ids=["sim", "real"])
STEP = ("experiment:=pd_step", "kp:=200")


@EVERYWHERE
def test_an_experiment_waits_for_its_armed_recorder(environment: tuple[str, ...]) -> None:
    values = parameters(
        loaded(
            "experiment:=pd_step",
            "record:=on_trigger",
            "subject:=007",
            "notes:=left hand, tired",
            "split_duration:=60",
            *environment,
        )
    )
    recorder = {
        name: values[f"/recorder/{name}"] for name in ("start", "subject", "notes", "split_size", "split_duration")
    }
    assert recorder == {
        "start": "on_trigger",
        "subject": "007",
        "notes": "left hand, tired",
        "split_size": 0,
        "split_duration": 60,
    }
    assert (values["/experiment/armed"], values["/experiment/record"]) == (True, True)


@pytest.mark.parametrize("given", [(*STEP, "record:=True"), STEP, (*REAL, *STEP)], ids=["asked for", "auto", "real"])
def test_a_recorder_starts_at_once_by_default(given: tuple[str, ...]) -> None:
    values = parameters(loaded(*given))
    assert (values["/recorder/start"], values["/experiment/armed"]) == ("now", False)


def test_an_experiment_adds_node_and_start() -> None:
    config = loaded(*STEP)
    assert nodes(config)["/experiment"] == "hric_experiments/experiment"
    values = parameters(config)
    assert values["/robot"]["q_start"][3] == -0.08
    assert "kp:=200" in str(values["/experiment/overrides"])
    assert "controllers:=" not in str(values["/spawner/overrides"])


CAPTURE = {"/natnet_client": "mocap_natnet/natnet_client", "/emulated_human": "hric_perception/emulated_human"}


def test_mocap_starts_emulated_human_and_client() -> None:
    config = loaded("experiment:=marker_tracking", "mocap_server:=127.0.0.3")
    assert nodes(config).items() >= CAPTURE.items()
    values = parameters(config)
    assert values["/natnet_client"]["body"] == "hand" and values["/natnet_client"]["server"] == "127.0.0.3"
    assert (
        values["/emulated_human"]["human"]["program"] == "sinusoid" and values["/emulated_human"]["ip"] == "127.0.0.3"
    )
    assert {"/natnet_client", "/emulated_human"} <= {
        node.namespace + node.name for node in config.nodes if node.required
    }


def test_one_argument_selects_the_real_motive(tmp_path: Path) -> None:
    saved = tmp_path / "base_from_mocap.yaml"
    saved.write_text("base_frame: panda_link0\nbase_from_mocap: {xyz: [1, 2, 3], xyzw: [0, 0, 0, 1]}\n")
    config = loaded(
        "experiment:=marker_tracking",
        "mocap:=motive",
        "mocap_server:=192.168.1.10",
        f"mocap_calibration:={saved}",
        "record:=false",
    )
    assert "/natnet_client" in nodes(config) and "/emulated_human" not in nodes(config)
    client = parameters(config)["/natnet_client"]
    assert (client["body"], client["server"], client["record"], client["base_frame"]) == (
        "hand",
        "192.168.1.10",
        False,
        "panda_link0",
    )
    assert client["base_from_mocap"]["xyz"] == [1, 2, 3]


def test_the_emulated_motive_has_a_default_body() -> None:
    config = loaded("mocap:=emulated")
    assert (
        nodes(config).items()
        >= {"/natnet_client": "mocap_natnet/natnet_client", "/emulated_motive": "mocap_natnet/emulated_motive"}.items()
    )


@pytest.mark.parametrize(
    ("given", "text"),
    [("mocap:=optitrack", "auto, none, emulated, motive"), ("real_time_factor:=0", "needs a paced run")],
)
def test_an_impossible_mocap_stops_the_launch(given: str, text: str) -> None:
    with pytest.raises(RLException, match=text):
        loaded("experiment:=marker_tracking", given)


SENSORS = {
    "/emulated_emg": "hric_perception/emulated_emg",
    "/emg": "hric_perception/emg",
    "/emulated_plate": "hric_perception/emulated_plate",
    "/force_plate": "hric_perception/force_plate",
    "/synchronizer": "hric_perception/synchronizer",
}


@EVERYWHERE
def test_a_data_collection_starts_every_sensor(environment: tuple[str, ...]) -> None:
    config = loaded("experiment:=data_collection", "mocap_server:=127.0.0.3", *environment)
    assert nodes(config).items() >= (SENSORS | CAPTURE).items()
    assert set(SENSORS) <= {node.namespace + node.name for node in config.nodes if node.required}
    values = parameters(config)
    assert values["/natnet_client"]["server"] == values["/emulated_human"]["ip"] == "127.0.0.3"
    assert (
        len(values["/emulated_emg"]["muscles"]) == 8
        and values["/emg"]["lsl"]["session"] == values["/emulated_emg"]["session"]
    )
    assert values["/synchronizer"]["rates"] == [100.0, 1000.0]
    assert "emg.device:=emulated" in str(values["/experiment/overrides"])


def test_one_argument_selects_each_real_sensor() -> None:
    config = loaded("experiment:=data_collection", "emg:=real", "force_plate:=real", "mocap:=motive")
    emulated = {"/emulated_emg", "/emulated_plate", "/emulated_human"}
    assert not emulated & set(nodes(config)) and {"/emg", "/force_plate", "/synchronizer", "/natnet_client"} <= set(
        nodes(config)
    )
    sources = parameters(config)["/synchronizer"]["plan"]["sources"]
    assert not any("time" in str(source["signals"]) for source in sources), "real devices have no time code"


def test_sensors_need_a_run_that_is_paced() -> None:
    with pytest.raises(RLException, match="need a paced run"):
        loaded("emg:=emulated", "real_time_factor:=0")


@pytest.mark.parametrize("env", ["sim", "real"])
def test_control_needs_the_window(env: str) -> None:
    with pytest.raises(RLException, match="control:=true needs the window"):
        loaded(f"env:={env}", "control:=true", "view:=false")


def test_every_argument_reaches_the_robot() -> None:
    given = (
        "ns:=/left arm_id:=left_arm hand:=false damping:=0.5 rotor_inertia:=0.2 gui:=true record:=false "
        "controller:=none real_time_factor:=0"
    )
    realism = {"preset": "measured", "dq_noise": 0}
    config = loaded(
        *given.split(), "xyz:=0 0.5 0", "q_start:=[0,-pi/4,0,-2.0,0,pi/2,0]", "realism:={preset: measured, dq_noise: 0}"
    )
    values = parameters(config)
    description = str(values["/left/robot_description"])
    assert (
        "left_arm_joint1" in description
        and "left_arm_hand" not in description
        and 'xyz="0 0.5 0"' in description
        and 'damping="0.5"' in description
    )
    assert values["/left/robot"]["plant"]["rotor_inertia"] == 0.2
    assert values["/left/robot"]["realism"] == realism and values["/left/robot"]["plant"]["friction"] == "identified"
    assert values["/left/joint_pd_controller/joints"][0] == "left_arm_joint1"
    assert not {"/left/recorder", "/left/franka_gripper"} & set(nodes(config))
    assert "controllers:=[joint_state_controller,franka_state_controller]" in str(values["/left/spawner/overrides"])


@pytest.mark.parametrize(
    ("given", "started"),
    [
        (("hand:=true", *STEP), True),
        (("load_gripper:=false",), False),
    ],
)
def test_the_gripper_follows_hand_or_argument(given: tuple[str, ...], started: bool) -> None:
    assert ("/franka_gripper" in nodes(loaded(*given))) == started


def test_the_gripper_is_the_arms_own() -> None:
    config = loaded("ns:=left", "arm_id:=left_arm", "env:=real", "robot_ip:=127.0.0.2")
    values = parameters(config)
    assert nodes(config)["/left/franka_gripper"] == "franka_real/franka_gripper"
    assert values["/left/franka_gripper/robot_ip"] == "127.0.0.2"
    assert values["/left/franka_gripper/arm_id"] == "left_arm"
    assert values["/left/franka_gripper/robot_joint_states"] == "joint_states"
    assert 'type="prismatic"' in str(values["/left/description_with_fingers"])
    assert 'type="prismatic"' not in str(values["/left/robot_description"]), "what the arm is reckoned with stays"


def test_rviz_starts_by_argument_or_display(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "/rviz" in nodes(loaded("rviz:=true")) and "/rviz" not in nodes(loaded())
    monkeypatch.setenv("DISPLAY", ":9")
    assert "/rviz" in nodes(loaded("rviz:=auto")) and "/rviz" not in nodes(loaded("rviz:=false"))


@pytest.mark.parametrize("space", ["/lab/", "/lab/left/"])
def test_a_group_gives_its_namespace(tmp_path: Path, space: str) -> None:
    own = tmp_path / "own.launch"
    argument = '<arg name="ns" value="left"/>' * ("left" in space)
    own.write_text(
        f'<launch><group ns="lab"><include file="{launch_file()}">{argument}<arg name="rviz" value="false"/></include>'
        "</group></launch>"
    )
    config = roslaunch.config.load_config_default([(str(own), [])], None, verbose=False, assign_machines=False)
    assert {name.startswith(space) for name in nodes(config)} == {True}
    assert {name for name in parameters(config) if not name.startswith(space)} <= {
        "/use_sim_time",
        "/rosdistro",
        "/rosversion",
        "/run_id",
    }
    assert all(["/tf", "tf"] in node.remap_args for node in config.nodes)


def test_viewers_start_and_are_not_recorded() -> None:
    config = loaded("rviz:=true")
    assert nodes(config)["/live_view"] == "hric_perception/live_view" and "/live_plot" not in nodes(config)
    assert re.fullmatch(parameters(config)["/recorder/exclude"], "/left/hric/view/limits")
    assert {"/live_view", "/live_plot"} <= set(
        nodes(loaded("env:=real", "robot_ip:=127.0.0.2", "rviz:=false", "view:=plot"))
    )


@pytest.mark.parametrize("words", [("env:=sim",), ("env:=real", "robot_ip:=127.0.0.2")])
def test_the_window_starts_on_request_or_without_display(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    assert nodes(loaded(*words, "rviz:=false", "view:=web"))["/window"] == "hric_view/window"
    assert nodes(loaded(*words))["/window"] == "hric_view/window"
    assert not any("/window" in nodes(loaded(*words, argument)) for argument in ("rviz:=false", "view:=true"))
    monkeypatch.setenv("DISPLAY", ":77")
    assert "/window" not in nodes(loaded(*words, "view:=auto"))  # other words, since the result is cached


@pytest.mark.parametrize("words", [("env:=sim",), ("env:=real", "robot_ip:=127.0.0.2")])
def test_only_control_true_lets_viewers_command(words: tuple[str, ...]) -> None:
    assert parameters(loaded(*words, "rviz:=false", "view:=web"))["/window/control"] is False
    assert parameters(loaded(*words, "rviz:=false", "control:=true"))["/window/control"] is True


def test_a_human_has_description_and_frames() -> None:
    config = loaded("experiment:=hand_guidance", "rviz:=true")
    values = parameters(config)
    body = urdf.read(str(values["/hric/human/robot_description"]))
    assert body.root == "human_base" and "r_wrist" in body.links
    (publisher,) = [node for node in config.nodes if node.name == "human_state_publisher"]
    remapped = {name: f"hric/human/{name}" for name in ("robot_description", "joint_states")}
    assert remapped.items() <= dict(publisher.remap_args).items()
    assert values["/human_state_publisher/tf_prefix"] == "human"
    (rviz,) = [node for node in config.nodes if node.name == "rviz"]
    assert rviz.args.endswith("panda_and_human.rviz")


def test_no_human_starts_no_human_nodes() -> None:
    config = loaded("rviz:=true")
    assert "/human_state_publisher" not in nodes(config)
    assert not [name for name in parameters(config) if "hric/human" in name]
    (rviz,) = [node for node in config.nodes if node.name == "rviz"]
    assert rviz.args.endswith("panda.rviz")


@pytest.mark.parametrize("arguments", [["env:=gazebo"], ["env:=real"]], ids=["no such environment", "no address"])
def test_an_impossible_environment_fails(arguments: list[str]) -> None:
    with pytest.raises(RLException):
        loaded(*arguments)


def test_the_real_arm_has_the_same_nodes() -> None:
    config, simulated = (
        loaded(*REAL, *STEP),
        loaded(*STEP),
    )
    assert nodes(config) == nodes(simulated)
    values, others = parameters(config), parameters(simulated)
    assert values["/use_sim_time"] is False
    assert values["/robot"]["robot_hw"] == "franka_real/FrankaHW"
    assert (values["/robot"]["robot_ip"], values["/robot"]["robot"]) == ("127.0.0.2", "panda")
    same = [name for name in others if "controller" in name]
    assert len(same) > 20
    assert {name: values[name] for name in same} == {name: others[name] for name in same}
    assert "hw:=franka_real/FrankaHW" in str(values["/recorder/overrides"])


def test_others_wait_for_the_emulated_arm() -> None:
    given = ("experiment:=hand_guidance", "simulator:=mujoco", "rotor_inertia:=0.2", "hand:=true", "ns:=left")
    config = loaded("env:=real", "robot_ip:=emulated", "robot:=fr3", *given)
    simulated = loaded("inertials:=fr3", *given)
    assert nodes(config).items() >= {"/left/emulated_arm": "franka_sim/emulated_arm"}.items()
    assert "/left/emulated_arm" in {node.namespace + node.name for node in config.nodes if node.required}
    values, others = parameters(config), parameters(simulated)
    arm = values["/left/emulated_arm"]
    assert (arm["ip"], arm["robot"], arm["plant_type"]) == ("127.0.0.1", "fr3", "mujoco_ros_control/MujocoPlant")
    assert {key: arm[key] for key in ("plant", "participants")} == {
        key: others["/left/robot"][key] for key in ("plant", "participants")
    }
    assert (values["/left/robot"]["robot_ip"], values["/left/robot"]["wait_for_arm"]) == ("127.0.0.1", 30)
    assert values["/left/franka_gripper/robot_ip"] == "127.0.0.1" and values["/left/franka_gripper/wait_for_arm"] == 30
    description = str(others["/left/robot_description"]).replace("franka_sim/FrankaHWSim", "franka_real/FrankaHW")
    limits = re.compile("<(limit|safety_controller) .*?/>")
    assert limits.sub("", str(values["/left/robot_description"])) == limits.sub("", description)
    joint6 = urdf.read(str(values["/left/robot_description"])).joints["panda_joint6"]
    assert (joint6.lower, joint6.upper) == (0.5445, 4.5169), "those of limits_fr3.yaml"
    assert values["/left/joint_limits"]["panda_joint6"]["min_position"] == 0.5445


def test_a_wrong_value_stops_the_launch() -> None:
    done = subprocess.run(
        ["roslaunch", "--nodes", PACKAGE, FILE, "inertials:=heavy"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode != 0
    assert "barycentric" in done.stdout + done.stderr


def test_every_argument_has_doc_and_unit() -> None:
    documented = roslaunch.arg_dump.get_args([launch_file()])
    for name, (doc, default) in documented.items():
        assert doc and len(doc) > 15, name
        assert default, f"{name} has no default; roslaunch --ros-args would call it required"
    for name in ("xyz", "rpy", "damping", "rotor_inertia", "q_start", "kp", "kd", "real_time_factor"):
        assert "[" in documented[name][0], name


def test_the_controllers_yaml_configures_every_named_instance() -> None:
    values = yaml.safe_load((Path(launch_file()).parents[1] / "config/controllers.yaml").read_text())
    motion = {"joint_pd_controller", "effort_joint_trajectory_controller", "position_joint_trajectory_controller"}
    assert motion | {"joint_state_controller", "franka_state_controller"} <= {
        name for name, value in values.items() if "type" in value
    }


@EVERYWHERE
def test_a_person_section_starts_its_tracker(environment: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "seen.yaml"
    packaged = Path(launch_file()).parents[2] / "hric_experiments" / "config" / "experiments" / "marker_tracking.yaml"
    path.write_text(packaged.read_text() + "person: {asset: body, force: {source: robot, hand: left}}\n")
    config = loaded(*environment, f"experiment:={path}", "record:=false")
    assert nodes(config)["/person"] == "hric_perception/person" and "/natnet_client" in nodes(config)
    assert parameters(config)["/person"] == {"asset": "body", "force": {"source": "robot", "hand": "left"}}
    assert "/person" not in nodes(loaded(*environment, *STEP))


def test_describe_names_its_choices_for_an_unknown_word() -> None:
    with pytest.raises(HricError, match=r"no description 'limit'; valid: .*emulated_emg.*natnet_client.*mean limits"):
        described("limit", "pd_step")
