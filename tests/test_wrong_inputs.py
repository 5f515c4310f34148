"""Invalid arguments end a program with exit code 2 and an error that names the valid ones; nothing is written."""

import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MISTAKE = 2
BLOCK = 18
"""Maximum number of lines of an error with usage, for the tool with the most options."""
SCRIPT_TIME = 0.3
"""Maximum processor time of a script [s]."""
NOBODY = "http://127.0.0.1:1"
"""Address without a ROS master."""

FILES = {
    "notes.txt": "not a bag\n",
    "notes.csv": "a,b\n1,2\n",
    "not.yaml": "robot: {hw: [\n",
    "list.yaml": "- 1\n",
    "body.yaml": "code: S1\nmass: 400\nheight: 1.8\nsexx: male\n",
    "wrong.yaml": "robot: {hw: franka_sim/FrankaHWSim}\ncontrolers: []\ncontrollers: [a]\nduration: -1\n",
    "study.yaml": "description: x\nforms: {a: {experiment: pd_step, runs: {b: []}, compared: [{runs: [b, c]}]}}\n",
    "scene.yaml": "bodys: []\n",
    "limits.yaml": "title: x\nedition: 2026\nsources: {us: own}\nsource: us\nforce_factor: 200\nforces:\n"
    "- {region: face, quasi_static: 65000}\n",
    "short.yaml": "title: x\nedition: 2026\nsources: {us: own}\nsource: us\nforces:\n"
    "- {region: chest, quasi_static: 140, transient: 14}\n",
    "work.yaml": "lifts: [{begin: 3, end: 2, load: 5}]\nrepetitive: [{factors: {pace: fast}}]\n",
    "stops.yaml": "title: x\nkind: measurement\nsource: me\nreaction_time: 100\nstops:\n"
    "- {speed: 1, time: 300}\n- {speed: 0.5, time: 0}\n",
    "cut.urdf": "<robot",
    "open/run.yaml": "experiment: pd_step\n",
}
"""Files of the user: content by path."""

SCRIPTS = [
    ("bringup envv:=real", r"no argument 'envv' \(did you mean env\?\); valid: .*simulator"),
    ("bringup env:=gazebo", r"env:=gazebo.*valid: sim, real"),
    ("bringup experiment:=step", r"experiment:=step: .*valid: co_transport, .*pd_step, .*\.yaml"),
    ("bringup kp:=abc", r"kp:=abc is not a number or a list of 7 numbers"),
    ("replay", r"required: RUN"),
    ("replay nowhere", r"no run folder 'nowhere' .*newest in .*/runs: none"),
    ("replay latest --rate=0", r"--rate: '0' is not possible; valid: a number above 0"),
    ("setup --fast", r"no option --fast\nusage: .*--check .*--no-gui .*--with PART"),
    ("setup --with everything", r"--with everything is not possible; valid: checks, pictures"),
    ("docs --open", r"unknown arguments: --open; valid: --serve or --check"),
    ("count --total", r"--at REVISION.*--check.*--twins.*--prose.*\n.*unrecognized arguments: --total"),
    ("lint --mend", r"no option --mend; valid: --fix"),
    ("test tests/test_nothing.py", r"no tests/test_nothing\.py; valid: .*src/PACKAGE/test.*--live, --all"),
]
"""Words after scripts/, and pattern of the error."""

TOOLS = [
    ("hric_core hric", r"hric: no command ''; valid: approaches, .*urdf"),
    ("hric_core hric rn pd_step", r"hric: no command 'rn'; valid: .*did you mean run\?"),
    ("hric_core hric run", r"hric run: exactly one experiment is needed; given: none; valid: .*pd_step"),
    ("hric_experiments run", r"exactly one experiment is needed; given: none; valid: .*pd_step"),
    ("hric_experiments run step_pd", r"no experiment 'step_pd' .*valid: co_transport, .*pd_step"),
    ("hric_experiments run pd_step kpp:=200", r"no override 'kpp' \(did you mean kp\?\); valid: .*kd, kp, limits"),
    ("hric_experiments run pd_step friction:=dry", r"'friction:=dry'; valid: none, coulomb, identified, or a YAML"),
    ("hric_experiments run pd_step duration:=-1", r"duration is -1; valid: a finite number above 0 \[s\]"),
    ("hric_experiments run pd_step kp:=stiff", r"joint_pd_controller/kp is 'stiff'; valid: .*\[N m/rad\]"),
    ("hric_experiments run pd_step simulator:=gazebo", r"'gazebo' .*valid: mujoco\w+/MujocoPlant, opensim"),
    ("hric_experiments run pd_step --seed -1", r"--seed is -1; valid: a whole number of 0 or more"),
    ("hric_experiments run pd_step --form soft", r"pd_step is not a study.*studies: .*engines"),
    (
        "hric_experiments run contact human.subject:=body.yaml",
        r"3 mistakes\n.*'sexx' in body\.yaml.*\n.*30 to 200 \[kg\]",
    ),
    ("hric_experiments run contact human.parts:=tail", r"human\.parts is 'tail'; valid: right_arm, left_arm"),
    (
        "hric_experiments run contact world:=wall.yaml",
        r"plant/world: no file wall\.yaml; valid: a world file by its path",
    ),
    (
        "hric_experiments run hand_guidance human.grips.guide.held:=hand",
        r"no link 'hand' in .*/guide; valid: .*panda_hand",
    ),
    (
        "hric_experiments run co_transport human.grips.hand.held:=sofa::link",
        r"no model 'sofa'.*valid: board",
    ),
    ("hric_experiments run co_transport human.position:=[3,0]", r"1\.\d+ m from the right shoulder; valid: up to 0\.6"),
    (
        "hric_experiments run co_transport human.control.parameters.load:=45",
        r"/load is 45\.0; valid: up to \d+(\.\d)? \[kg\], which right_\w+ can hold",
    ),
    (
        "hric_experiments run hand_guidance human.watches:=panda_elbow",
        r"no link 'panda_elbow' in .*/watches; valid: panda_hand",
    ),
    ("hric_experiments run not.yaml", r"not\.yaml is not YAML: .*line 2, column 1"),
    (
        "hric_experiments run wrong.yaml",
        r"2 mistakes\n +no parameter 'controlers'; valid: arms, controllers.*\n +duration",
    ),
    ("hric_experiments run study.yaml", r"forms\.a\.compared\[0\]\.runs is 'c'; valid: two of b"),
    ("hric_experiments describe robott pd_step", r"no description 'robott'; valid: controllers.*did you mean robot\?"),
    ("hric_experiments report nowhere", r"no run folder 'nowhere' .*newest in .*/runs: none"),
    ("hric_experiments health notes.txt", r"notes\.txt is not a bag of version 2\.0"),
    ("hric_experiments health open", r"no bag in .*/open: neither open\.bag nor open\.bag\.active"),
    (
        "hric_experiments export notes.txt",
        r"--format\s+\{npz,csv,.*c3d,bids,xdf,lerobot,bag,mcap,ros2\}.*\n.*required: --format",
    ),
    ("hric_experiments export notes.txt --format xls", r"no format 'xls'; valid: bag, bids, c3d, csv"),
    ("hric_experiments export notes.txt --format csv", r"cannot read notes\.txt: .*health --salvage"),
    ("hric_experiments compare open nowhere", r"no run folder 'nowhere'"),
    ("hric_experiments compare open open --labels a", r"--labels needs 2 names, one for each run; given: a"),
    (
        "hric_experiments schema --studies",
        r"\[--study\] \[--sweep\] \[--example\]\n.*unrecognized arguments: --studies",
    ),
    (
        "hric_experiments check_model notes.csv",
        r"notes\.csv has no columns t .*columns in the file: a, b; .*--columns t=NAME",
    ),
    (
        "hric_experiments measure_stops --speeds 40",
        r"no pose reaches 40 m/s within the joint velocity limits; valid: lower speeds",
    ),
    ("hric_experiments speed_map --region face", r"permits no contact with face at any speed; valid: neck; "),
    ("hric_experiments inverse_dynamics nowhere", r"no run folder 'nowhere'"),
    ("hric_experiments film nowhere", r"no run folder 'nowhere'"),
    ("hric_experiments muscle_load nowhere.c3d", r"person of nowhere\.c3d is not known; add --person RUN\|EXP"),
    ("hric_experiments trial nowhere.csv", r"nowhere\.csv: No such file or directory"),
    (
        "hric_experiments trial nowhere.xyz",
        r"nowhere\.xyz is not a trial; valid: a \.c3d, \.xdf, \.trc, \.csv or \.mvnx file",
    ),
    ("hric_experiments trial nowhere.c3d --mass 70 --subject body.yaml", r"--subject and --mass contradict each other"),
    ("hric_experiments spawn pd_step", r"usage: .*\[_PARAMETER:=VALUE \.\.\.\]\n.*unrecognized arguments: pd_step"),
    ("hric_control robot here", r"\[_robot_hw:=TYPE\].*\n.*unrecognized arguments: here"),
    ("controller_manager controller_manager lod", r"invalid choice: 'lod' \(choose from '?list'?, .*'?load'?"),
    ("controller_manager spawner nowhere.yaml", r"nowhere\.yaml cannot be read: No such file"),
    ("controller_manager spawner list.yaml", r"list\.yaml must be a mapping of controllers' names to their"),
    ("controller_manager spawner _x:=1 a", r"spawner: no parameter 'x' in ~spawner; valid: none"),
    ("controller_manager unspawner _x:=1 a", r"unspawner: no parameter 'x' in ~unspawner; valid: none"),
    ("controller_manager controller_manager _x:=1 list", r"no parameter 'x' in ~controller_manager; valid: none"),
    ("controller_manager unspawner --timeout soon a", r"--timeout: invalid float value: 'soon'"),
    ("franka_sim control_box --robot ur5", r"invalid choice: 'ur5' \(choose from '?panda'?, '?fr3'?\)"),
    ("franka_sim control_box --ip here", r"--ip is 'here'; valid: an IPv4 address"),
    ("franka_sim control_box --loss 2", r"--loss is 2\.0; valid: a finite number from 0 to 1"),
    ("franka_sim control_box --realism clean", r"no preset 'clean' in --realism; valid: ideal, measured"),
    ("franka_sim control_box --plant nope/X", r"'nope/X' .*valid: mujoco\w+/MujocoPlant, opensim"),
    (
        "franka_sim control_box two_arms --friction none",
        r"--friction and the experiment two_arms both describe the arm",
    ),
    ("franka_sim control_box ur5e_step", r"experiment ur5e_step: .*ur5e.* has no control box; valid: Franka arms"),
    (
        "franka_sim control_box two_arms arms.left.robot.parameters.ip:=here",
        r"/left/robot/ip is 'here'; valid: an IPv4",
    ),
    ("franka_real check_workstation --repair", r"\[--fix\] \[robot_ip\]\n.*unrecognized arguments: --repair"),
    (
        "mocap_natnet emulated_motive --transport tcp",
        r"invalid choice: 'tcp' \(choose from '?unicast'?, '?multicast'?\)",
    ),
    ("mocap_natnet emulated_motive --rate 0", r"rate is 0\.0; valid: a finite number from 0\.001 to 10000 \[Hz\]"),
    ("mocap_natnet emulated_motive --scene scene.yaml", r"'bodys' in scene\.yaml; valid: bodies, plates"),
    ("mocap_natnet emulated_motive --occlude 1:2:head", r"--occlude names the body 'head'; valid: marker"),
    ("mocap_natnet natnet_client 10.0.0.1", r"\[_server:=127\.0\.0\.1\].*unrecognized arguments: 10\.0\.0\.1"),
    ("hric_perception emg --source lsl", r"\[_source:=lsl\].*\n.*unrecognized arguments: --source lsl"),
    ("hric_perception live_plot speed", r"no panel 'speed'; valid: efforts, emg"),
    ("hric_perception live_plot --screenshot x.bmp", r"--screenshot x\.bmp: .*valid: \.png, \.svg, \.pdf"),
    (
        "hric_assessment assess --limits limits.yaml",
        r"force_factor is 200; valid: .*from 1 to 10.*quasi_static is 65000; valid: .* above 0 to 1000",
    ),
    ("hric_assessment assess --limits short.yaml", r"transient is 14\.0; valid: quasi_static, 140, or more"),
    (
        "hric_assessment assess --stop stops.yaml",
        r"100 ms would be 0\.1 s.*300 ms would be 0\.3 s.*time is 0;.*valid: .* above 0 to 10",
    ),
    (
        "hric_assessment assess --work work.yaml",
        r"lifts\[0\]\.end is 2\.0; valid: a number above begin \(3\).*no pace 'fast' .*; valid: free, machine, partly",
    ),
    ("hric_assessment assess --picture x.png", r"--picture is x\.png; valid: a file name \.svg"),
    ("hric_experiments export notes.txt --format csv --surface 0.05", r"--surface has no effect; .*c3d"),
    (
        "hric_experiments export notes.txt --format csv --load-body hand_r",
        r"--load-body has no effect",
    ),
    ("hric_experiments export notes.txt --format c3d --surface 50", r"--surface is 50\.0; .*50 mm would be 0\.05 m"),
    ("panda_description urdf hand:=true hand:=false", r"argument hand is given more than once"),
    ("panda_description urdf color:=red", r"no argument 'color'; valid: arm_id, .*hand"),
    ("panda_description urdf damping:=[1,", r"damping is '\[1,'; valid: a finite number of 0 or more"),
    ("panda_description inertials --set mine", r"invalid choice: 'mine' \(choose from .*'?fr3'?, '?thesis'?\)"),
    ("xacro xacro nowhere.xacro", r"No such file or directory: .*nowhere\.xacro"),
    ("urdf_to_osim urdf_to_osim nowhere.urdf", r"no file nowhere\.urdf"),
    ("urdf_to_osim urdf_to_osim cut.urdf", r"cut\.urdf: the robot description is not XML: unclosed token: line 1"),
    ("urdf_to_osim picture nowhere.osim --pose elbow", r"--pose elbow: it must be COORDINATE=VALUE"),
]
"""Words after rosrun, and pattern of the error."""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Home folder to which a tool could write, with the user's files in `here`."""
    folder = tmp_path_factory.mktemp("home")
    for name in ("ros", "runs", "here"):
        (folder / name).mkdir()
    for name, content in FILES.items():
        path = folder / "here" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(content)
    return folder


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy of the workspace without set-up."""
    folder = tmp_path_factory.mktemp("workspace")
    parts = ("scripts", "tests/house", "src/hric_bringup", "src/hric_experiments/config", "src/hric_bags/src")
    for part in (*parts, "src/hric_core/src"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def contents(folder: Path) -> dict[str, tuple[int, int]]:
    return {
        str(path.relative_to(folder)): (state.st_mtime_ns, state.st_size)
        for path in folder.rglob("*")
        if (state := path.lstat())
    }


def answer(command: list[str], home: Path, environment: dict[str, str]) -> str:
    """Run a command with invalid arguments, check exit code and written files, and return its error message."""
    own = {"HOME": str(home), "ROS_HOME": str(home / "ros"), "HRIC_RUNS": str(home / "runs"), "ROS_MASTER_URI": NOBODY}
    own["XDG_CACHE_HOME"] = str(home.parent / "cache")  # a description read before the mistake may be kept there
    before = contents(home)
    done = subprocess.run(
        command,
        cwd=home / "here",
        env=environment | own | {"PYTHONDONTWRITEBYTECODE": "1"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == MISTAKE, done.stdout + done.stderr
    assert done.stdout == "" and "Traceback" not in done.stderr, done.stdout + done.stderr
    assert 1 <= done.stderr.count("\n") <= BLOCK and "\n\n" not in done.stderr, done.stderr
    assert contents(home) == before
    return done.stderr


@pytest.mark.parametrize(("words", "pattern"), TOOLS, ids=[words for words, _ in TOOLS])
def test_a_tool_says_what_is_wrong_and_what_is_valid_and_writes_nothing(words: str, pattern: str, home: Path) -> None:
    package, tool, *others = shlex.split(words)
    node = ROOT / "src" / package / "nodes" / tool
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "ROS_LOG_DIR")}
    told = answer([sys.executable, str(node), *others], home, environment)
    assert re.search(pattern, told, re.DOTALL), told


def test_mistakes_in_an_experiment_file_end_the_bring_up_before_anything_starts(home: Path) -> None:
    told = answer([str(ROOT / "scripts/bringup"), "experiment:=wrong.yaml"], home, {**os.environ})
    assert re.search(r"scripts/bringup: experiment wrong: 2 mistakes\n +no parameter 'controlers'; valid: ", told), told


@pytest.mark.parametrize(("words", "pattern"), SCRIPTS, ids=[words for words, _ in SCRIPTS])
def test_a_script_says_it_before_any_set_up_and_with_next_to_no_computing(
    words: str, pattern: str, home: Path, copy: Path
) -> None:
    """Run with a Python without packages."""
    script, *others = shlex.split(words)
    before, began = contents(copy), resource.getrusage(resource.RUSAGE_CHILDREN)
    told = answer([str(copy / "scripts" / script), *others], home, {"PATH": os.defpath})
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert re.search(pattern, told, re.DOTALL), told
    assert ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime < SCRIPT_TIME
    assert contents(copy) == before
