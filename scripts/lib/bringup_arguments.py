"""Check of the arguments of scripts/bringup before anything starts, even before the set-up.

roslaunch silently accepts misspelt names and values. This file needs only Python and the source code of the workspace.

    python3 bringup_arguments.py [NAME:=VALUE ...]      # help, or one error and exit code 2
    python3 bringup_arguments.py --complete WORD        # completions of the word for the shell
"""

import ast
import ipaddress
import math
import os
import re
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

WORKSPACE = Path(__file__).resolve().parents[2]
sys.path.append(str(WORKSPACE / "src/hric_core/src"))
from hric_core import plugins
from hric_core.errors import HricError

LAUNCH = WORKSPACE / "src/hric_bringup/launch/bringup.launch"
CONTROLLERS = WORKSPACE / "src/hric_bringup/config/controllers.yaml"
EXPERIMENTS = WORKSPACE / "src/hric_experiments/config/experiments"
Documented = Mapping[str, tuple[str, str]]
"""Default and explanation by name of the argument."""


class ArgumentError(HricError):
    """Error of a name or value that bringup.launch cannot use; the message lists the valid ones."""


@dataclass(frozen=True)
class Choices:
    """Valid names of controllers, experiments and engines.

    Attributes:
        controllers: instance names in controllers.yaml and in the YAML files of packages that export controllers.
        experiments: names of the shipped experiment files.
        having: names of the experiments with a section, by name of the section (`DEVICES` and `HUMAN`).
        engines: short names of the physics engines.
    """

    controllers: tuple[str, ...]
    experiments: tuple[str, ...]
    having: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    engines: tuple[str, ...] = ()


SENSORS = ("emg", "force_plate")
DEVICES = ("mocap", *SENSORS)
"""Names of sections of an experiment file that are also arguments."""
HUMAN = "human"
"""Name of the section of an experiment file with the simulated person."""
UR5E = "ur5e"
"""Value of `robot` for an arm of Universal Robots, which takes positions only."""
POSITION_CONTROLLERS = ("position_joint_trajectory_controller", "joint_streaming_controller", "none")
"""Controllers of the bring-up that such an arm can execute."""
EMULATED = "emulated"
"""Value of `robot_ip` for an emulated arm on this machine, which the bring-up starts."""
BROADCASTERS = ("joint_state_controller", "franka_state_controller")
"""Controllers that only publish; bringup.launch always starts them."""
BOOL = ("true", "false")
REALISM = ("auto", "ideal", "measured")
JOINTS = 7


def documented() -> dict[str, tuple[str, str]]:
    """Return default and explanation of each argument of bringup.launch."""
    arguments = ET.parse(LAUNCH).getroot().iterfind("arg")
    return {arg.get("name", ""): (arg.get("default", ""), arg.get("doc", "")) for arg in arguments}


def choices() -> Choices:
    """Return the names of controllers and experiments in this workspace."""
    # The packages of the workspace, which are not on the path before the set-up, and those of the shell.
    packages = os.pathsep.join([str(WORKSPACE / "src"), os.environ.get("ROS_PACKAGE_PATH", "")])
    folders = dict.fromkeys(info.source.parent for info in plugins.names(plugins.CONTROLLER, packages).values())
    files = [CONTROLLERS, *(path for folder in folders for path in sorted(folder.glob("config/*.yaml")))]
    controllers = dict.fromkeys(name for path in files for name in instances(path.read_text()))
    experiments = sorted(EXPERIMENTS.glob("*.yaml"))
    having = {name: tuple(path.stem for path in experiments if has_section(path, name)) for name in (*DEVICES, HUMAN)}
    engines = tuple(plugins.engines(packages))
    return Choices(tuple(controllers), tuple(path.stem for path in experiments), having, engines)


def instances(text: str) -> list[str]:
    """Return the names of the controllers in a YAML text: the keys of mappings with a key `type`.

    Mistakes in the text are reported when the controllers are loaded."""
    blocks = re.split(r"^(?=[A-Za-z_]\w*:)", text, flags=re.MULTILINE)
    typed = re.compile(r"[A-Za-z_]\w*:[ \t]*(?:#.*)?(?:\{(?:.*[{, ])?type:|(?:\n(?:[ \t].*)?)*?\n[ \t]+type:)")
    return [block.partition(":")[0] for block in blocks if typed.match(block)]


def help_text(arguments: Documented) -> str:
    """Return the text of --help: all arguments with default and explanation."""
    return "\n".join([
        "usage: scripts/bringup [NAME:=VALUE ...]",
        "",
        "Runs scripts/setup if needed, then runs the arm until Ctrl-C or the end of the experiment.",
        "",
        *(f"  {name}:={default}\n      {doc}" for name, (default, doc) in arguments.items()),
        "",
        "examples:",
        "  scripts/bringup env:=sim",
        "  scripts/bringup env:=sim rviz:=false experiment:=pd_step kp:=200 kd:=100",
        "  scripts/bringup env:=real robot_ip:=172.16.0.2 experiment:=pd_step",
        "  scripts/bringup env:=real robot_ip:=emulated experiment:=pd_step",
        "  scripts/bringup env:=sim experiment:=marker_tracking",
        "  scripts/bringup env:=sim experiment:=data_collection",
        "  scripts/bringup env:=sim experiment:=marker_tracking mocap:=motive mocap_server:=192.168.1.10",
    ])  # fmt: skip


def split(arguments: Iterable[str]) -> dict[str, str]:
    """Return the values of arguments NAME:=VALUE by name.

    Raises:
        ArgumentError: an argument does not have this form, or a name is given twice.
    """
    result: dict[str, str] = {}
    for argument in arguments:
        name, separator, value = argument.partition(":=")
        if not separator or not name:
            hint = f"; did you mean {argument.replace('=', ':=', 1)} ?" if "=" in argument else ""
            raise ArgumentError(
                f"cannot read {argument!r}: arguments are written name:=value, for example env:=sim{hint}"
            )
        if name in result:
            raise ArgumentError(f"{name} is given twice: {result[name]!r} and {value!r}")
        result[name] = value.strip()
    return result


def check(arguments: Mapping[str, str], valid_names: Iterable[str], known: Choices) -> dict[str, str]:
    """Check the arguments and return them for roslaunch, with absolute paths.

    Args:
        arguments: values from the command line by name.
        valid_names: names of the arguments of bringup.launch.
        known: names that exist in this workspace.

    Raises:
        ArgumentError: a name or value is invalid; the message lists the valid ones.
    """
    names = sorted(valid_names)
    for name in arguments:
        if name not in names:
            close = get_close_matches(name, names, n=1)
            hint = f" (did you mean {close[0]}?)" if close else ""
            raise ArgumentError(
                f"no argument {name!r}{hint}; valid: {', '.join(names)}.  scripts/bringup --help explains them"
            )
    checks = _checks(known)
    _check_environment(arguments)
    checked = {name: checks[name](name, value) if name in checks else value for name, value in arguments.items()}
    _check_human(checked, known)
    _check_mocap(checked, known)
    _check_sensors(checked, known)
    if checked.get("control") == "true" and checked.get("view", "auto") not in ("auto", "web"):
        raise ArgumentError(f"control:=true needs the window; valid: with view:=web, not view:={checked['view']}")
    return checked


Check = Callable[[str, str], str]

ONLY_SIMULATED = (
    "arms",
    "simulator",
    "gui",
    "world",
    "friction",
    "damping",
    "rotor_inertia",
    "realism",
    "q_start",
    "real_time_factor",
)
"""Arguments for the simulation only."""
ONLY_PACED = ("real_time_factor",)
"""Arguments for the simulation that an emulated arm, which runs in real time, does not accept."""
ONLY_REAL = ("robot_ip", "robot")
"""Arguments for the real arm only."""
ONLY_RECORDED = ("subject", "notes", "split_size", "split_duration")
"""Arguments for the recording only."""


def _check_environment(arguments: Mapping[str, str]) -> None:
    """Raise ArgumentError for arguments that have no effect in the environment (env), and for a missing robot_ip."""
    real = arguments.get("env") == "real"
    emulated = arguments.get("robot_ip") == EMULATED
    foreign = [name for name in arguments if name in (ONLY_SIMULATED if real else ONLY_REAL)]
    if real and emulated:
        foreign = [name for name in foreign if name in ONLY_PACED]
    if foreign:
        raise ArgumentError(f"{', '.join(foreign)} can be given with env:={'sim' if real else 'real'} only")
    if real and "robot_ip" not in arguments:
        raise ArgumentError(
            "env:=real needs the address of the arm's control box, for example robot_ip:=172.16.0.2, or "
            "robot_ip:=emulated"
        )
    if arguments.get("robot") == UR5E:
        _check_ur(arguments)
    if "arm_id" in arguments and arguments.get("arms", "none") != "none":
        raise ArgumentError("arm_id can be given for one arm only; valid: without arms")
    unrecorded = [name for name in arguments if name in ONLY_RECORDED]
    if unrecorded and arguments.get("record", "").lower() == "false":
        raise ArgumentError(
            f"{', '.join(unrecorded)} can be given with a recording only; valid: record:=true or record:=on_trigger"
        )


def _check_ur(arguments: Mapping[str, str]) -> None:
    """Raise ArgumentError for arguments that an arm of Universal Robots cannot use."""
    if arguments["robot_ip"] == EMULATED:
        raise ArgumentError(
            f"robot_ip:=emulated starts an emulated arm of Franka; valid with robot:={UR5E}: robot_ip:=127.0.0.2, with "
            "hric ur_controller --ip 127.0.0.2 in another terminal"
        )
    franka = [name for name in ("arm_id", "hand", "load_gripper", "inertials", "xyz", "rpy") if name in arguments]
    if franka:
        raise ArgumentError(f"{', '.join(franka)} can be given for an arm of Franka only; valid: without robot:={UR5E}")
    controller = arguments.get("controller", "the default joint_pd_controller")
    if "experiment" not in arguments and controller not in POSITION_CONTROLLERS:
        raise ArgumentError(
            f"{controller} does not command joint positions, and robot:={UR5E} takes nothing else; valid: controller:="
            f"{', '.join(POSITION_CONTROLLERS)}"
        )


def has_section(path: Path, name: str) -> bool:
    """Return True if an experiment file has a top-level section, by the text search of the launch files.

    A file that cannot be read counts as having no section; reading the experiment reports its error later."""
    try:
        return f"\n{name}:" in "\n" + path.read_text()
    except (OSError, UnicodeDecodeError):
        return False


def device(name: str, arguments: Mapping[str, str], known: Choices) -> str:
    """Return the selected device of motion capture or a sensor; auto is emulated if the experiment has its section.

    Args:
        name: one of `DEVICES`.
        arguments: checked arguments.
        known: names that exist in this workspace.
    """
    value = arguments.get(name, "auto")
    if value != "auto":
        return value
    return "emulated" if _has(name, arguments, known) else "none"


def _has(name: str, arguments: Mapping[str, str], known: Choices) -> bool:
    """Return True if the experiment in the arguments has a section of this name."""
    experiment = arguments.get("experiment", "none")
    own_file = experiment.endswith((".yaml", ".yml")) and has_section(Path(experiment), name)
    return own_file or experiment in known.having.get(name, ())


def _check_human(arguments: Mapping[str, str], known: Choices) -> None:
    if arguments.get("env") == "real" and arguments["robot_ip"] != EMULATED and _has(HUMAN, arguments, known):
        raise ArgumentError(
            f"experiment:={arguments['experiment']} has a simulated human, who cannot act on a real arm; valid: "
            "robot_ip:=emulated, or env:=sim"
        )


def _unpaced(arguments: Mapping[str, str]) -> bool:
    factor = _loaded("real_time_factor", arguments.get("real_time_factor", "1"))
    return _numbers("real_time_factor", factor, "1")[0] == 0.0


def _check_sensors(arguments: Mapping[str, str], known: Choices) -> None:
    chosen = {name: device(name, arguments, known) for name in SENSORS}
    used = ", ".join(f"{name}:={value}" for name, value in chosen.items() if value != "none")
    if used and _unpaced(arguments):
        raise ArgumentError(
            f"real_time_factor:=0 is not possible with sensors ({used}), which are received over the network "
            "and need a paced run; valid: a factor above 0"
        )


def _check_mocap(arguments: Mapping[str, str], known: Choices) -> None:
    chosen = device("mocap", arguments, known)
    if chosen == "none" and arguments.get("mocap_server", "auto") != "auto":
        raise ArgumentError("mocap_server needs motion capture; valid: with mocap:=motive or mocap:=emulated")
    if chosen != "motive" and arguments.get("mocap_calibration", "none") != "none":
        raise ArgumentError(
            "mocap_calibration needs mocap:=motive: the experiment defines the pose of the emulated motion capture"
        )
    if chosen != "none" and arguments.get("arms", "none") != "none" and not _has("mocap", arguments, known):
        raise ArgumentError(
            f"mocap:={chosen} with several arms needs an experiment whose section mocap names one of them: mocap.arm"
        )
    if chosen != "none" and _unpaced(arguments):
        raise ArgumentError(
            f"real_time_factor:=0 is not possible with motion capture (mocap:={chosen}), which is received over the "
            "network and needs a paced run; "
            "valid: a factor above 0, or the headless runner, hric run"
        )


WORDS: dict[str, tuple[str, ...]] = {
    "env": ("sim", "real"),
    "robot": ("panda", "fr3", UR5E),
    "rviz": (*BOOL, "auto"),
    "view": (*BOOL, "auto", "plot", "web"),
    "control": BOOL,
    "record": (*BOOL, "auto", "on_trigger"),
    "html": BOOL,
    "mocap": ("auto", "none", "emulated", "motive"),
    **dict.fromkeys(SENSORS, ("auto", "none", "emulated", "real")),
    "gui": BOOL,
    "hand": (*BOOL, "auto"),
    "load_gripper": (*BOOL, "auto"),
    "inertials": ("barycentric", "fr3", "thesis", "auto"),
}
"""Valid values of arguments that accept one of a few words."""


def _checks(known: Choices) -> dict[str, Check]:
    return {
        **{name: _one_of(*valid_words(name, known)) for name in (*WORDS, "simulator", "controller")},
        "robot_ip": _matching(
            r"(?!none$)[A-Za-z0-9]([A-Za-z0-9.:-]*[A-Za-z0-9])?", "is not an address; for example NAME:=172.16.0.2"
        ),
        "experiment": _experiment(known.experiments),
        "subject": _matching(
            "[A-Za-z0-9][A-Za-z0-9_-]{0,31}",
            "is not a valid code; valid: letters, digits, - and _, at most 32, for example NAME:=P07. Do not use names "
            "of people",
        ),
        "notes": _notes,
        "split_size": _single("0 means never"),
        "split_duration": _single("0 means never"),
        "mocap_server": _ip_address,
        "mocap_calibration": lambda name, value: value if value == "none" else _existing_file(name, value),
        "friction": _friction,
        "ns": _namespace,
        "arms": _arms,
        "arm_id": _matching(r"[^\W\d]\w*", "is not a name; letters, digits and underscores, for example NAME:=panda"),
        "xyz": _vector,
        "rpy": _vector,
        "world": _world,
        "damping": _not_negative,
        "rotor_inertia": _not_negative,
        "kp": _not_negative,
        "kd": _not_negative,
        "realism": _matching(
            rf"{'|'.join(REALISM)}|\{{.*\}}",
            f"is not possible; valid: {', '.join(REALISM)}, or for example {{preset: measured, dq_noise: 0}}",
        ),
        "real_time_factor": _single("1 is real time, 2 twice as fast, 0 as fast as possible"),
        "q_start": _angles,
    }


def _one_of(*valid: str) -> Check:
    def checked(name: str, value: str) -> str:
        lowered = value.lower() if value.lower() in BOOL else value
        if lowered not in valid:
            raise ArgumentError(f"{name}:={value} is not possible; valid: {', '.join(valid)}")
        return lowered

    return checked


def _matching(pattern: str, refusal: str) -> Check:
    """Return a check by a regular expression.

    Args:
        pattern: regular expression of the whole value.
        refusal: end of the error message, after name and value; NAME in it is replaced by the name.
    """

    def checked(name: str, value: str) -> str:
        if not re.fullmatch(pattern, value):
            raise ArgumentError(f"{name}:={value} {refusal.replace('NAME', name)}")
        return value

    return checked


def _ip_address(name: str, value: str) -> str:
    try:
        return value if value == "auto" else str(ipaddress.IPv4Address(value))
    except ValueError:
        raise ArgumentError(
            f"{name}:={value} is not an IPv4 address; for example {name}:=192.168.1.10, or auto"
        ) from None


def _experiment(names: tuple[str, ...]) -> Check:
    def checked(name: str, value: str) -> str:
        if value in names or value == "none":
            return value
        if value.endswith((".yaml", ".yml")):
            return _existing_file(name, value)
        raise ArgumentError(
            f"{name}:={value}: no such experiment; valid: {', '.join(names)}, none, or the path of a .yaml file"
        )

    return checked


def _existing_file(name: str, value: str) -> str:
    path = Path(value).expanduser()
    if not path.is_file():
        raise ArgumentError(f"{name}:={value}: there is no such file (looked at {path.absolute()})")
    return str(path.absolute())


def _world(name: str, value: str) -> str:
    return value if value in ("auto", "none") or value.startswith("package://") else _existing_file(name, value)


def _friction(name: str, value: str) -> str:
    if value.endswith((".yaml", ".yml")):
        return _existing_file(name, value)
    valid = ("none", "coulomb", "identified", "auto")
    if value not in valid:
        raise ArgumentError(
            f"{name}:={value} is not possible; valid: {', '.join(valid)}, or the path of a .yaml file with the "
            "friction of each joint"
        )
    return value


def _namespace(name: str, value: str) -> str:
    parts = value.strip("/").split("/") if value.strip("/") else []
    if not all(part.isidentifier() for part in parts):
        raise ArgumentError(
            f"{name}:={value} is not a namespace; letters, digits and underscores, for example {name}:=left"
        )
    return "/".join(parts)


def _arms(name: str, value: str) -> str:
    names = [part.strip() for part in value.split(",")]
    valid = all(part.isidentifier() for part in names) and len(set(names)) == len(names) > 1
    if value != "none" and not valid:
        raise ArgumentError(f"{name}:={value} is not possible; valid: different names, for example {name}:=left,right")
    return ",".join(names)


def _numbers(name: str, value: object, example: str) -> list[float]:
    items: list[object] = value if isinstance(value, list) else [value]
    numbers = [
        float(item)
        for item in items
        if isinstance(item, int | float) and not isinstance(item, bool) and math.isfinite(item)
    ]
    if not numbers or len(numbers) != len(items):
        raise ArgumentError(
            f"{name}:={value} is not a number or a list of {JOINTS} numbers; for example {name}:={example}"
        )
    return numbers


def _loaded(name: str, value: str) -> object:
    """Return the value as a Python literal, such as a number or a list; other texts unchanged."""
    try:
        literal: object = ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return value
    return literal


def _not_negative(name: str, value: str) -> str:
    if value == "auto":
        return value
    loaded = _loaded(name, value)
    numbers = _numbers(name, loaded, "0.1")
    if min(numbers) < 0.0 or (isinstance(loaded, list) and len(numbers) != JOINTS):
        raise ArgumentError(f"{name}:={value}: must be 0 or more, one number or {JOINTS} of them in brackets")
    return value


def _notes(name: str, value: str) -> str:
    if ":=" in value:
        raise ArgumentError(f"{name} cannot contain ':=', which separates names from values")
    return value or "none"


def _single(meaning: str) -> Check:
    def checked(name: str, value: str) -> str:
        loaded = _loaded(name, value)
        if isinstance(loaded, list) or _numbers(name, loaded, "1")[0] < 0.0:
            raise ArgumentError(f"{name}:={value}: must be one number of 0 or more; {meaning}")
        return value

    return checked


def _vector(name: str, value: str) -> str:
    parts = value.replace(",", " ").split()
    try:
        good = len(parts) == 3 and all(math.isfinite(float(part)) for part in parts)
    except ValueError:
        good = False
    if not good:
        raise ArgumentError(f"{name}:={value!r} must be three numbers in quotes, for example {name}:='0 0 0.5'")
    return " ".join(parts)


def _angles(name: str, value: str) -> str:
    count = len(value.strip("[] ").split(","))
    if value != "auto" and not (value.startswith(("[", "{")) and (value.startswith("{") or count == JOINTS)):
        raise ArgumentError(
            f"{name}:={value} must be {JOINTS} angles [rad] in brackets, for example "
            f"{name}:=[0,-pi/4,0,-3*pi/4,0,pi/2,pi/4]"
        )
    return value.replace(" ", "")


def completed(word: str) -> list[str]:
    """Return the completions of a word for the shell: names of arguments, or after NAME:= values of this argument."""
    name, separator, begun = word.partition(":=")
    arguments = documented()
    if not separator:
        return [f"{argument}:=" for argument in arguments if f"{argument}:=".startswith(word)]
    return [f"{name}:={value}" for value in valid_words(name, choices()) if value.startswith(begun)]


def valid_words(name: str, known: Choices) -> tuple[str, ...]:
    """Return the words that an argument accepts; empty for arguments that accept numbers, paths or other texts."""
    words = {
        "controller": (*(word for word in known.controllers if word not in BROADCASTERS), "none"),
        "experiment": (*known.experiments, "none"),
        "simulator": (*known.engines, "auto"),
    }
    return words.get(name) or WORDS.get(name, ())


def main(argv: list[str]) -> int:
    """Print help or completions, or check the arguments; return the exit code."""
    if argv[:1] == ["--complete"]:
        print("\n".join(completed(argv[1] if len(argv) > 1 else "")))
        return 0
    arguments = documented()
    if {"-h", "--help"} & set(argv):
        print(help_text(arguments))
        return 0
    try:
        check(split(argv), arguments, choices())
    except ArgumentError as error:
        print(f"scripts/bringup: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
