"""A simulated arm that is not too clean: noise as the sensors report it, a body and a friction that the box does not
know."""

import math
import struct
from collections.abc import Callable, Iterator
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yaml
from fci_peer import CONTROL_BOX

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import read_config
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest
from franka_sim.fci.app import ControlBoxCommand
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.protocol import PROTOCOL_5 as V5
from franka_sim.fci.robots import ROBOTS
from franka_sim.fci.world_building import make_arm
from franka_sim.realism import IDEAL, parse, presets
from franka_sim.sensors import attach
from hric_core.command import main
from hric_core.errors import HricError

URDF = panda_description.load(meshes=False, collision=False)
MEASURED = parse("measured", "robot/realism")


@pytest.fixture
def make_device() -> Iterator[Callable[..., ArmDevice]]:
    """make_device(word, ...) -> the arm of the command `control_box` with these words, without shapes."""
    made: list[ArmDevice] = []

    def make(*words: str, robot: str = "panda") -> ArmDevice:
        made.append(make_arm(ControlBoxCommand().parser().parse_args(["--no-collision", *words]), ROBOTS[robot]))
        return made[-1]

    yield make
    for arm in made:
        arm.close()


def seen(arm: ArmDevice, cycles: int) -> np.ndarray:
    """Return q, dq, tau_J and the external wrench of each cycle, shape (cycles, 27)."""
    rows = []
    for _ in range(cycles):
        arm.cycle(None)
        rows.append([*arm.state.q, *arm.state.dq, *arm.state.tau_J, *arm.state.O_F_ext_hat_K])
    return np.array(rows)


# -- the parameter -----------------------------------------------------------------------------------------------------


def test_ideal_is_the_default_and_changes_nothing() -> None:
    ideal = parse(IDEAL, "")
    assert (
        presets() == ("ideal", "measured")
        and parse({}, "") == ideal
        and ControlBoxCommand().parser().parse_args([]).realism == IDEAL
    )
    assert not ideal.noisy
    assert ideal.body(URDF, "panda") is URDF
    assert ideal.with_friction({"rotor_inertia": 0.1}, "panda") == {"rotor_inertia": 0.1}
    friction = ideal.with_friction({"friction": "identified"}, "panda")
    assert ideal.known_friction(friction, ["panda_joint1"]) is friction["friction_parameters"]


def test_an_ideal_arm_is_read_as_without_sensors(make_device, make_arm) -> None:
    device, hw = make_device(), make_arm().hw
    assert device._read_state == device.plant.read_state
    assert hw._read_state == hw.plant.read_state
    assert device.state.wrench_noise is hw.robot_state.wrench_noise is None


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("noisy", "no preset 'noisy' in robot/realism; valid: ideal, measured"),
        (["measured"], "no preset ['measured'] in robot/realism; valid: ideal, measured"),
        (
            {"preset": "measured", "q_nois": 1.0},
            "no value 'q_nois' in robot/realism; valid: body_seed, breakaway, com_error, dq_noise, friction",
        ),
        ({"q_noise": -1e-3}, "robot/realism/q_noise is -0.001; valid: a finite number of 0 or more [rad]"),
        (
            {"dq_noise": [1e-3] * 6},
            "robot/realism/dq_noise is [0.001, 0.001, 0.001, 0.001, 0.001, 0.001]; valid: 7 values",
        ),
        ({"tau_J_noise": float("nan")}, "robot/realism/tau_J_noise is nan"),
        ({"tau_J_noise": "big"}, "robot/realism/tau_J_noise is 'big'"),
        ({"wrench_noise": 0.1}, "robot/realism/wrench_noise is 0.1; valid: a list of 6 finite numbers of 0 or more"),
        ({"mass_error": 0.5}, "robot/realism/mass_error is 0.5; valid: a finite number from 0 to 0.3"),
        ({"friction": "coulomb"}, "robot/realism/friction is 'coulomb'; valid: none, identified"),
        ({"body_seed": 1.5}, "robot/realism/body_seed is 1.5; valid: a whole number of 0 or more"),
    ],
)
def test_what_is_no_realism_is_refused_with_what_is_valid(value, said) -> None:
    with pytest.raises(HricError) as error:
        parse(value, "robot/realism")
    assert said in str(error.value)


def test_each_value_of_a_preset_can_be_overridden() -> None:
    changed = parse({"preset": "measured", "tau_J_noise": [0, 1, 2, 3, 4, 5, 6], "friction_known": 1}, "")
    assert changed.tau_J_noise == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0) and changed.friction_known == (1.0,) * 7
    assert changed.dq_noise == MEASURED.dq_noise
    assert all(set(values) == set(read_config("realism")["ideal"]) for values in read_config("realism").values())


def test_the_command_takes_a_preset_or_yaml_and_refuses_the_rest_in_one_line(capsys) -> None:
    assert CONTROL_BOX.is_file()
    assert main(["control_box", "--realism", "{preset: measured, noise: 1}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("hric control_box: no value 'noise' in --realism; valid: body_seed")
    with pytest.raises(SystemExit) as ended:
        main(["control_box", "--realism", "{preset: "])
    assert ended.value.code == 2 and "is not YAML" in capsys.readouterr().err


# -- noise -------------------------------------------------------------------------------------------------------------


def test_the_noise_is_white_and_has_the_requested_size(make_box) -> None:
    """4000 readings of an arm that stands: a standard deviation is within 5 % (4.5 of its own), means and correlations
    within 4.5 of theirs."""
    asked = {
        "q_noise": [1e-4 * i for i in range(1, 8)],
        "dq_noise": 2e-3,
        "tau_J_noise": 0.1,
        "wrench_noise": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3],
    }
    sigma, most = np.array([*asked["q_noise"], *[2e-3] * 7, *[0.1] * 7, *asked["wrench_noise"]]), 4.5 / math.sqrt(4000)
    arm = make_box()
    read = attach(arm.plant, arm.box, parse(asked, ""), 7)
    exact, row, rows = np.zeros((3, 7)).tolist(), np.zeros((3, 7)).tolist(), []
    arm.plant.read_state(*exact)
    for _ in range(4000):
        read(*row)
        rows.append([*np.subtract(row, exact).ravel(), *arm.state.wrench_noise])
    noise = np.array(rows) / sigma
    assert noise.std(axis=0) == pytest.approx(1.0, rel=0.05)
    assert np.abs(noise.mean(axis=0)).max() < most
    assert np.abs(noise).max() < 5.001
    assert np.abs(np.corrcoef(noise.T) - np.eye(27)).max() < most
    assert np.abs(np.mean(noise[1:] * noise[:-1], axis=0)).max() < most


def test_a_seed_gives_the_same_noise_in_process_and_behind_the_network_and_another_seed_another(
    make_device, make_arm
) -> None:
    one, same, other = (seen(make_device("--realism", "measured", "--seed", seed), 100) for seed in ("3", "3", "4"))
    assert np.array_equal(one, same)
    assert not np.any(one[:, :27] == other[:, :27])
    hw = make_arm(plant={"seed": 3}, parameters={"realism": "measured"}).hw
    device = make_device("--realism", "measured", "--seed", "3")
    noise = [arm.state.wrench_noise for arm in (hw.box, device)]
    assert any(noise[0]) and noise[0] == noise[1]


def test_controllers_box_and_wire_see_the_same_noise(make_device, make_arm) -> None:
    hw = make_arm(parameters={"realism": "measured"})
    hw.run(0.05)
    states, state = hw.hw.states, hw.hw.robot_state
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    hw.hw.plant.read_state(q, dq, tau)
    assert states.position == state.q != q and states.velocity == state.dq != dq and states.effort == state.tau_J != tau
    arm = make_device("--realism", "measured")
    for _ in range(50):
        arm.cycle(None)
    sent = struct.unpack_from("<284d", arm.encode(V5.state, 1), 8)
    assert sent == pytest.approx(struct.unpack_from("<284d", V5.state.encode(1, arm.state), 8), rel=1e-12, abs=1e-9)
    assert list(sent[147:154]) == arm.state.q and list(sent[215:221]) == pytest.approx(
        arm.state.O_F_ext_hat_K, abs=1e-12
    )


def test_the_noise_of_the_wrench_is_added_in_the_base_and_turned_into_the_stiffness_frame() -> None:
    box = ControlBox(KdlFrankaModel(URDF, "panda"), CompiledArm(URDF, "panda", 0.05))
    q, noise = [0.1, -0.7, 0.2, -2.0, 0.3, 1.7, 0.4], [1.0, -2.0, 3.0, 0.1, 0.2, -0.3]
    box.reset(q)
    box.state.tau_ext_hat_filtered[:] = [1.0, -2.0, 3.0, -1.0, 0.5, 0.2, -0.1]
    clean = np.array(box.state.O_F_ext_hat_K)
    box.take_wrench_noise(noise, 10.0)
    box.state.tick += 1
    R = np.array(box.state.O_T_EE).reshape(4, 4).T[:3, :3]
    found = np.array(box.state.O_F_ext_hat_K)
    assert found == pytest.approx(clean + noise, abs=1e-12)
    assert box.state.K_F_ext_hat_K == pytest.approx([*(R.T @ found[:3]), *(R.T @ found[3:])], abs=1e-9)
    box.reset([0.0, 0.0, 0.0, -0.07, 0.0, 0.5, 0.0])  # near a singular pose there is no estimate, noisy or not
    box.state.tau_ext_hat_filtered[:] = [1.0] * 7
    assert box.state.O_F_ext_hat_K == [0.0] * 6


def test_noise_of_the_wrench_alone_can_be_a_collision(make_device, torques) -> None:
    """The reflexes look at the wrench only where the torques allow it to be large; its noise counts among what can make
    it so."""
    arm = make_device("--realism", yaml.safe_dump({"wrench_noise": [8.0, 0.0, 0.0, 0.0, 0.0, 0.0]}))
    arm.move(MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE))
    for _ in range(1000):
        arm.cycle(torques())
        if arm.state.robot_mode is not RobotMode.MOVE:
            break
    assert arm.state.current_errors == {"cartesian_reflex"}
    assert max(map(abs, arm.state.tau_ext_hat_filtered)) < 0.1


def test_a_reset_goes_on_with_the_noise(make_device) -> None:
    arm = make_device("--realism", "measured")
    first = seen(arm, 40)
    arm.reset()
    assert not np.any(first[:, :7] == seen(arm, 40)[:, :7])


# -- the body ----------------------------------------------------------------------------------------------------------


def inertias(urdf: str) -> dict[str, pin.Inertia]:
    """Return the inertia of each moving link by the name of its joint, as another library reads it."""
    model = pin.buildModelFromXML(urdf)
    return {name: model.inertias[i] for i, name in enumerate(model.names)}


def test_the_body_of_the_plant_differs_from_the_one_that_the_box_knows_within_the_requested_errors() -> None:
    one = parse({"mass_error": 0.1, "com_error": 0.01, "body_seed": 5}, "")
    nominal, other = (
        inertias(panda_description.load(hand=False)),
        inertias(one.body(panda_description.load(hand=False), "panda")),
    )
    masses = np.array([other[f"panda_joint{i}"].mass / nominal[f"panda_joint{i}"].mass for i in range(1, 8)])
    moved = np.array([other[f"panda_joint{i}"].lever - nominal[f"panda_joint{i}"].lever for i in range(1, 8)])
    assert 0.02 < np.abs(masses - 1.0).mean() < 0.2 and np.abs(masses - 1.0).max() <= 0.3
    assert 0.003 < np.abs(moved).mean() < 0.02 and np.abs(moved).max() <= 0.03
    for i, factor in enumerate(masses, start=1):
        tensor = other[f"panda_joint{i}"].inertia
        assert tensor == pytest.approx(factor * nominal[f"panda_joint{i}"].inertia, rel=1e-9)
        moments = np.linalg.eigvalsh(tensor)
        assert moments[0] > 0.0 and moments[0] + moments[1] >= moments[2]


def test_it_is_the_same_arm_in_every_run_and_another_specimen_with_another_number(make_device) -> None:
    measured = [make_device("--realism", "measured", "--seed", seed).plant.mass_matrix() for seed in ("1", "2")]
    assert np.array_equal(*measured)
    other = make_device("--realism", "{preset: measured, body_seed: 2}").plant.mass_matrix()
    assert np.abs(other - measured[0]).max() > 1e-3


def test_only_the_links_of_the_arm_differ_and_the_rest_of_the_description_stays() -> None:
    before, after = (ElementTree.fromstring(text) for text in (URDF, MEASURED.body(URDF, "panda")))
    for one, other in zip(before.iter(), after.iter(), strict=True):
        assert (one.tag, one.text) == (other.tag, other.text)
    for one, other in zip(before.iterfind("link"), after.iterfind("link"), strict=True):
        name = one.get("name", "")
        same = ElementTree.tostring(one) == ElementTree.tostring(other)
        assert same != (name in {f"panda_link{i}" for i in range(1, 8)}), name
    assert max(map(len, MEASURED.body(URDF, "panda").splitlines())) < 8191  # Bullet reads lines in pieces of that size


@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_the_box_keeps_the_arm_that_it_believes_in(make_device, robot: str) -> None:
    arm, ideal = make_device("--realism", "measured", robot=robot), make_device(robot=robot)
    q = arm.q_start
    assert np.array_equal(arm.box.model.mass(q), ideal.box.model.mass(q)) and arm.urdf() == ideal.urdf()
    assert 0.005 < np.abs(arm.plant.mass_matrix() - ideal.plant.mass_matrix()).max() < 0.5


# -- friction ----------------------------------------------------------------------------------------------------------


def test_the_box_knows_a_share_of_the_friction_that_acts(make_arm) -> None:
    hw = make_arm(parameters={"realism": "measured"}).hw
    acting, known = panda_description.friction_parameters(), hw.box.config.friction
    assert hw.plant.config.friction == "identified"
    for name, share in zip(hw.states.names, MEASURED.friction_known, strict=True):
        assert known[name] == {**acting[name], "phi1": share * acting[name]["phi1"]}
    ignorant = make_arm(parameters={"realism": {"preset": "measured", "friction_known": 0.0}}).hw
    assert ignorant.plant.config.friction == "identified" and ignorant.box.config.friction is None


def test_the_breakaway_of_the_preset_is_the_plants_alone_unless_its_parameters_name_one(make_arm) -> None:
    hw = make_arm(parameters={"realism": "measured"}).hw
    acting = hw.plant.config.friction_parameters
    assert [acting[name]["breakaway"] for name in hw.states.names] == list(MEASURED.breakaway)
    assert all("breakaway" not in known for known in hw.box.config.friction.values())
    own = {name: {**phi, "breakaway": 0.7} for name, phi in panda_description.friction_parameters().items()}
    lists = {key: [own[name][key] for name in own] for key in ("phi1", "phi2", "phi3")}
    config = {"friction": "identified", "friction_parameters": own}
    assert MEASURED.with_friction(config, "panda") == config
    of_lists = MEASURED.with_friction({**config, "friction_parameters": lists}, "panda")["friction_parameters"]
    assert of_lists == {**lists, "breakaway": list(MEASURED.breakaway)}
    assert MEASURED.known_friction({**config, "friction_parameters": lists}, list(own)) == hw.box.config.friction


@pytest.mark.parametrize("friction", ["none", "coulomb", "identified"])
def test_friction_that_the_plant_is_given_goes_before_that_of_the_preset(make_arm, friction: str) -> None:
    hw = make_arm(plant={"friction": friction}, parameters={"realism": "measured"}).hw
    assert hw.plant.config.friction == friction
    assert (hw.box.config.friction is not None) == (friction == "identified")
