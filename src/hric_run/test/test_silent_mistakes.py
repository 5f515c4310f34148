"""Mistakes that change nothing, or make a run of something else, end each command at once: exit code 2, what would be
valid, and nothing written."""

import re
import shlex
from pathlib import Path

import pytest

from hric_core.command import main

PD = "parameters.joint_pd_controller"
GUIDED = "run hand_guidance parameters.cartesian_impedance_controller"
IMPEDANCE = "parameters.cartesian_impedance_controller"
SUBJECT = "code: S1\nsex: male\nmass: {mass}\nheight: {height}\n"
FILES = {
    "heavy.yaml": SUBJECT.format(mass=75000, height=1.8),
    "tall.yaml": SUBJECT.format(mass=75, height=180),
    "wall.yaml": "objects:\n- {name: wall, shape: box, size: [600, 400, 20], pose: {xyz: [0.9, 0, 0]}}\n",
    "far.yaml": "objects:\n- {name: wall, shape: box, size: [0.6, 0.4, 0.02], pose: {xyz: [900, 0, 0]}}\n",
    "heavy_ball.yaml": "objects:\n- {name: ball, shape: sphere, size: 0.05, mass: 250}\n",
    "slippery.yaml": "objects:\n- {name: ball, shape: sphere, size: 0.05, mass: 0.25, friction: 40}\n",
    "going.yaml": "objects:\n- {name: wall, shape: box, size: [1, 1, 1], velocity: {linear: [1, 0, 0]}}\n",
    "twofold.yaml": "objects:\n- {name: wall, shape: box, size: [1, 1, 1], urdf: x.urdf}\n",
    "empty.yaml": "",
    "twice.yaml": "extends: pd_step\nchanges: ['kd:=5', 'kd:=6']\nsweep: {vary: {kp: {paths: kp, distribution: "
    "{kind: uniform, low: 50, high: 60}}}, sampler: {kind: random}, runs: 2, outputs: {e: {path: limits_touched}}}\n",
    "endless.yaml": "extends: pd_step\nsweep: {vary: {kp: {paths: kp, distribution: "
    "{kind: uniform, low: 50, high: 60}}}, sampler: {kind: random}, runs: 1000000000000, memory: 4096, "
    "outputs: {e: {path: limits_touched}}}\n",
    "smooth.urdf": "<robot name='r'><link name='base'/><link name='arm'><inertial><mass value='1'/><inertia ixx='1' "
    "iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link><joint name='a' type='continuous'><parent link='base'/>"
    "<child link='arm'/></joint></robot>",
    "smooth.yaml": "robot: {hw: hric_control/RobotHWSim, urdf: smooth.urdf}\n"
    "controllers: [joint_state_controller]\nduration: 1.0\n",
    "cartesian.yaml": "robot: {hw: franka_sim/FrankaHWSim}\ncontrollers: [cartesian_impedance_controller]\n"
    "duration: 1.0\n",
    "still.urdf": "<robot name='r'><link name='base'/><link name='arm'><inertial><mass value='1'/><inertia ixx='1' "
    "iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link><joint name='a' type='continuous'><parent link='base'/>"
    "<child link='arm'/><limit effort='0' velocity='0'/></joint><transmission name='t'><type>transmission_interface/"
    "SimpleTransmission</type><joint name='a'><hardwareInterface>hardware_interface/EffortJointInterface"
    "</hardwareInterface></joint><actuator name='m'/></transmission></robot>",
    "still.yaml": "robot: {hw: hric_control/RobotHWSim, urdf: still.urdf}\n"
    "controllers: [joint_state_controller]\nduration: 1.0\n",
    "step.yaml": "robot: {hw: franka_sim/FrankaHWSim, parameters: {reflexs: false}}\n"
    "controllers: [joint_pd_controller]\n"
    "parameters: {joint_pd_controller: {strict_gain: true}}\nduration: 1.0\n",
    "other.yaml": "robot: {hw: hric_control/RobotHWSim, urdf: r.urdf, description: {hand: true}}\n"
    "controllers: [joint_state_controller]\nduration: 1.0\n",
    "study.yaml": "description: x\nforms: {a: {experiment: pd_step, runs: {b: [], c: ['" + PD + ".kpp:=10']}, "
    "compared: [{runs: [b, c]}]}}\n",
    "restated.yaml": "description: x\nforms: {a: {experiment: pd_step, runs: {b: ['kd:=5', 'kd:=6'], c: []}, "
    "compared: [{runs: [b, c]}]}}\n",
    "controller.yaml": "description: mine\nchanges: {contact: ['" + PD + ".kdd:=10']}\n",
}
MISTAKES = [
    (f"run pd_step {PD}.kpp:=200", r"no parameter 'kpp' in /joint_pd_controller; .*did you mean kp\?"),
    (f"run pd_step {PD}.profile.velocty:=1", r"no parameter 'velocty' .*did you mean velocity\?"),
    (f"run pd_step {PD}.Kd:=5", r"no parameter 'Kd' in /joint_pd_controller; .*kd"),
    (f"{GUIDED}.translational_stifness:=50", r"did you mean translational_stiffness\?"),
    ("run pd_step parameters.joint_state_controller.rate:=10", r"no parameter 'rate' .*publish_rate"),
    ("run pd_step robot.parameters.reflexs:=false", r"no parameter 'reflexs' in /robot; .*did you mean reflexes\?"),
    ("run pd_step robot.parameters.controllog:=false", r"did you mean control_log\?"),
    (
        "run pd_step 'robot.parameters.plant:={gravity: [0, 0, 0]}'",
        r"parameters\.plant has no effect; valid: robot\.plant",
    ),
    ("run pd_step robot.parameters.arm_id:=left", r"parameters\.arm_id has no effect; valid: robot\.arm_id"),
    ("run pd_step robot.load.com:=[0,0,0.1]", r"load\.com has no effect .*valid: with robot\.load\.mass above 0"),
    (
        "run pd_step friction:=none 'robot.plant.friction_parameters:={phi1: [1]}'",
        r"has no effect; valid: with .*friction: identified",
    ),
    ("run pd_step kp=200", r"'kp=200' is not a valid override; valid: kp:=200"),
    ("run pd_step kp:=100 kp:=200", r"kp is given more than once"),
    (f"run pd_step kp:=100 {PD}.kp:=200", r"kp has no effect with parameters\.joint_pd_controller\.kp"),
    ("run pd_step robot.load.mass:=1 'robot.load:={mass: 2}'", r"robot\.load\.mass has no effect with robot\.load"),
    ("run pd_step friction:=none robot.plant.friction:=identified", r"both set robot\.plant\.friction"),
    ("run pd_step urdf:=r.urdf hand:=true", r"robot\.description\.hand has no effect with robot\.urdf"),
    ("run pd_step 'robot.description.xyz:=[1,0,0]' urdf:=r.urdf", r"description\.xyz has no effect with robot\.urdf"),
    ("run other.yaml", r"robot\.description\.hand has no effect with robot\.urdf"),
    ("run pd_step 'kp:={panda_joint8: 1}'", r"no joint 'panda_joint8' .*did you mean panda_joint7"),
    ("run pd_step 'robot.plant.rotor_inertia:={panda_joint8: 1}'", r"no joint 'panda_joint8' .*did you mean"),
    ("run step.yaml", r"no parameter 'reflexs'"),
    ("run study.yaml", r"no parameter 'kpp'"),
    ("run pd_step q_start:=[0,-45,0,-135,0,90,45]", r"4 mistakes\n.*-45 deg would be -0\.785398 rad"),
    ("run pd_step 'q_start:={panda_joint2: -5}'", r"/robot/q_start/panda_joint2 is -5\.0; .*-5 deg would be"),
    (
        "run pd_step setpoints.0.positions:=[0,-2,0,-2,0,2,2]",
        r"outside -1\.7628 to 1\.7628; -2 deg",
    ),
    ("run pd_step duration:=4000", r"4000 ms would be 4 s"),
    ("run pd_step robot.load.mass:=750", r"valid: .* to 20 \[kg\]; 750 g would be 0\.75 kg"),
    ("run pd_step kp:=50000", r"50000 N mm/rad would be 50 N m/rad"),
    (f"run pd_step {PD}.profile.velocity:=57", r"57 deg/s would be 0\.994838 rad/s"),
    ("run pd_step 'robot.description.rpy:=[0,0,90]'", r"90 deg would be 1\.5708 rad"),
    ("run pd_step robot.plant.gravity:=[0,0,-9810]", r"-9810 mm/s\^2 would be -9\.81 m/s\^2"),
    (
        "run pd_step robot.plant.gravity:=[0,0,9.81]",
        r"valid: .* 10 at most in size and the third not above 0 \[m/s\^2\]",
    ),
    ("run pd_step robot.plant.gravity:=[0,0,-98.1]", r"gravity is .*98\.1.*; valid: "),
    ("run pd_step metrics.tolerances:=[5]", r"tolerances\[0\] is 5; valid: .*5 deg would be 0\.0872665 rad"),
    ("run pd_step metrics.tolerances:=0.01", r"metrics\.tolerances is 0\.01; valid: a list of"),
    (
        "run pd_step robot.parameters.real_time_factor:=2",
        r"real_time_factor has no effect; valid: scripts/bringup real_time_factor:=FACTOR",
    ),
    ("run pd_step robot.parameters.wait_for_log_listener:=2", r"has no effect; valid: scripts/bringup record:=true"),
    (f"run pd_step {PD}.kp_all:=50", r"/joint_pd_controller/kp_all cannot be given before the start; valid: kp and kd"),
    (
        "run pd_step 'robot.plant:={friction: identified, friction_parameters: {panda_joint8: {phi1: 1}}}'",
        r"no joint 'panda_joint8' .*panda_joint1, .*did you mean panda_joint7",
    ),
    (
        "run pd_step 'robot.plant:={friction: identified, friction_parameters: []}'",
        r"identified needs friction_parameters",
    ),
    ("run pd_step robot.plant.time_step:=1", r"1 ms would be 0\.001 s"),
    ("run pd_step world:=wall.yaml", r"size is .*600 mm would be 0\.6 m"),
    ("run pd_step world:=heavy_ball.yaml", r"ball\]\.mass is 250\.0; valid: up to .*250 g would be 0\.25 kg"),
    ("run pd_step world:=slippery.yaml", r"friction is 40; valid: a finite number from 0 to 10"),
    ("run pd_step world:=going.yaml", r"velocity has no effect without a mass"),
    ("run pd_step world:=twofold.yaml", r"urdf has no effect on a box"),
    ("run pd_step world:=empty.yaml", r"empty\.yaml is empty; valid: a mapping with objects, surfaces"),
    ("run empty.yaml", r"empty\.yaml must be a mapping with the keys"),
    ("run restated.yaml", r"runs\.b is .*: kd is given more than once"),
    ("sweep twice.yaml", r"changes is .*: kd is given more than once"),
    ("sweep endless.yaml", r"runs is 1000000000000; (.|\n)*memory is 4096"),
    (
        "run pd_step 'setpoints:=[{time: 1, controller: joint_state_controller, positions: [0,-1,0,-2,0,1,0]}]'",
        r"setpoints of joint_state_controller have no effect: this controller does not subscribe",
    ),
    (
        "run pd_step 'setpoints:=[{time: 1, controller: joint_pd_controller, positions: [0,-1,0,-2,0,1,0]}, "
        "{time: 1, controller: joint_pd_controller, positions: [0,-1,0,-2,0,1,1]}]'",
        r"setpoints\[1\]\.time .* s is used twice for",
    ),
    (f"run pd_step {PD}.rotatum_limit:=1e9", r"at most 1e\+06 in size \[N m/s\]"),
    (f"run pd_step {PD}.gain_ramp:=1000", r"1000 ms would be 1 s"),
    ("run pd_step parameters.joint_state_controller.publish_rate:=0.01", r"valid: a finite number from 0\.1 to 10000"),
    (
        "run pd_step 'robot.plant.payload:={mass: 1, inertia: [1, 0, 0, 0, 0, -1]}'",
        r"payload/inertia is \[1\.0, .*valid: that of a body",
    ),
    (f"run cartesian.yaml {IMPEDANCE}.energy_tank.largest:=2", r"energy_tank/largest has no effect; .*initial above 0"),
    (f"run cartesian.yaml {IMPEDANCE}.feedforward.largest_force:=9", r"largest_force has no effect; .*timeout above 0"),
    (f"run cartesian.yaml {IMPEDANCE}.joint_repulsion.torque:=9", r"repulsion/torque has no effect; .*margin above 0"),
    ("run pd_step robot.load.mass:=1 robot.load.com:=[0,0,5]", r"com is \[0, 0, 5\]; valid: .* from -1 to 1 \[m\]"),
    ("run contact human.muscles.rate:=50", r"human\.muscles\.rate has no effect; valid: with human\.drive: muscle"),
    ("run contact human.contact_area:=0.4", r"human\.contact_area is 0\.4 m\^2, .*did you mean 0\.4 cm\^2"),
    ("run contact human.heading:=10", r"10 deg would be 0\.174533 rad"),
    (
        "run contact 'human.walk:={points: [[0,0,0],[1,25,0]]}'",
        r"points: the speed after 0 s is '46\.9 m/s'; valid: up to 12\.5",
    ),
    ("run hand_guidance human.grips.guide.close.distance:=5", r"5 mm would be 0\.005 m"),
    ("run hand_guidance human.grips.guide.handle:=[0,0,10]", r"handle is \[0, 0, 10\]; valid: .* from -3 to 3 \[m\]"),
    ("run hand_guidance human.grips.guide.release.delay:=1", r"delay has no effect; valid: with .*release\.load"),
    ("run hand_guidance human.grips.guide.damping:=1e9", r"at most 1e\+06 in size \[N s/m\]"),
    ("run shared_workspace supervisor.guided_force:=50", r"no effect; valid: with supervisor\.mode: hand_guided"),
    ("run shared_workspace supervisor.contact_stiffness:=50", r"with supervisor\.mode: power_and_force_limiting"),
    ("run shared_workspace supervisor.body:=foot", r"body has no effect; valid: with supervisor\.source: marker"),
    ("run shared_workspace supervisor.hold:=300", r"300 ms would be 0\.3 s"),
    ("run marker_tracking mocap.human.amplitude:=[0,15,5]", r"amplitude is \[0, 15, 5\]; valid: .* from -2 to 2 \[m\]"),
    ("run pd_step simulator:=opensim robot.plant.accuracy:=100", r"valid: a finite number above 0 to 0\.1"),
    ("run smooth.yaml friction:=coulomb", r"friction: coulomb has no effect: no joint has <dynamics friction>"),
    ("run still.yaml", r"joint a: its limit of effort and velocity is 0, .*valid: above 0, in its <limit> or in"),
    (
        "run pd_step robot.description.friction:=none robot.plant.friction:=coulomb",
        r"friction: coulomb has no effect: no joint has <dynamics friction>",
    ),
    ("run pd_step world:=far.yaml", r"xyz is .*900 mm would be 0\.9 m"),
    ("run contact human.position:=[850,0]", r"850 mm would be 0\.85 m"),
    ("run contact human.heading:=180", r"180 deg would be 3\.14159 rad"),
    ("run contact human.subject:=heavy.yaml", r"30 to 200 \[kg\]; 75000 g would be 75 kg"),
    ("run contact human.subject:=tall.yaml", r"1\.2 to 2\.2 \[m\]; 180 cm would be 1\.8 m"),
    (
        "run hand_guidance human.control.parameters.reference.points:=[[0.5,420,0,550]]",
        r"at most 30 in size \[m, rad\]; 420 mm would be 0\.42 m",
    ),
    ("run marker_tracking mocap.base_from_mocap.xyz:=[100,0,0]", r"100 mm would be 0\.1 m"),
    ("benchmark controller.yaml", r"changes\.contact: .*no parameter 'kdd' .*did you mean kd\?"),
]
"""Words after `hric`, and the expected error message."""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("home")
    for name, content in FILES.items():
        (folder / name).write_text(content)
    return folder


@pytest.mark.parametrize(("words", "message"), MISTAKES, ids=[words for words, _ in MISTAKES])
def test_it_is_refused_with_what_is_valid_before_anything_is_written(
    words: str, message: str, home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(home)
    monkeypatch.setenv("HRIC_RUNS", str(home / "runs"))
    try:
        code = main(shlex.split(words))
    except SystemExit as end:  # argparse's own
        code = int(end.code or 0)
    shown = capsys.readouterr()
    assert code == 2, shown.out + shown.err
    assert re.search(message, shown.err), shown.err
    assert sorted(path.name for path in home.iterdir()) == sorted(FILES)
