"""Reader of C++ controllers of ros_control and franka_ros: interfaces, parameters, topics, calls. Compiles nothing."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hric_core.errors import HricError

LIFE_CYCLE = ("init", "starting", "update", "stopping")
"""Methods of a controller that the controller manager calls."""
TEXT = r'"((?:\\.|[^"\\])*)"'
TYPE = r"([\w:]+(?:\s*::\s*\w+)*)"
COMMENTS = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
INCLUDE = re.compile(r'#\s*include\s*[<"]([\w./-]+\.(?:h|hpp|hh))[">]')
EXPORT = re.compile(r"PLUGINLIB_EXPORT_CLASS\s*\(\s*([\w:]+)\s*,")
CLASS = re.compile(r"\bclass\s+(\w+)\s*(?:final\s*)?:\s*public\s+(?:\w+\s*::\s*)*(?:Multi\w*)?Controller\w*\s*<")
INTERFACE = re.compile(r"\b(\w+::\w+Interface)\b")
UNQUALIFIED = re.compile(r"[<,]\s*(\w+Interface)\s*(?=[,>])")
ALIAS = re.compile(r"\bnamespace\s+(\w+)\s*=\s*(?:::)?([\w:]+)\s*;")
NODE = r"(?:(\w+)\s*)?(?:\.|->)\s*"
PARAMETER = re.compile(
    r"(?:"
    + NODE
    + r"(getParam|getParamCached|param|hasParam|searchParam)|ros::param::(?:get|param|has))\s*(?:<[^;()]*?>)?\s*\("
)
NAME = r"([^,;()]+(?:\([^()]*\)[^,;()]*)*)\s*"
SUBSCRIPTION = re.compile(NODE + r"subscribe\s*(?:<\s*" + TYPE + r"[^;()]*>)?\s*\(\s*" + NAME + ",")
SUBSCRIBE_OPTIONS = re.compile(r"(\w)\.init\s*(?:<\s*" + TYPE + r"\s*>)?\s*\(\s*(" + TEXT + ")")
ADVERTISED = re.compile(NODE + r"advertise\s*<\s*" + TYPE + r"\s*>\s*\(\s*" + NAME + ",")
REALTIME = re.compile(
    r"RealtimePublisher\s*<\s*" + TYPE + r"\s*>\s*>?\s*(\w*)\s*(?:\(\s*([\w*>.-]+)\s*,\s*" + NAME + r",)?"
)
REALTIME_INIT = re.compile(r"(\w+)\s*(?:\.|->)\s*init\s*\(\s*([\w*]+)\s*,\s*(" + TEXT + ")")
SERVICE = re.compile(
    NODE + r"(advertiseService|serviceClient)\s*(?:<\s*" + TYPE + r"[^;()]*>)?\s*\(\s*" + NAME + "[,)]"
)
CHILD_NODE = re.compile(r"\bNodeHandle\s+(\w+)\s*[({]\s*(?:\*?(\w+)\s*,\s*)?" + TEXT)
TWO_NODES = re.compile(r"\binit\s*\([^)]*\bNodeHandle\s*&?\s*(\w+)[^)]*\bNodeHandle\s*&?\s*\w+")
ACTION = re.compile(r"SimpleAction(Server|Client)\s*<\s*" + TYPE + r"\s*>")
LIVE = re.compile(r"dynamic_reconfigure\s*::\s*Server\s*<\s*" + TYPE + r"\s*>")
HANDLE = re.compile(r"\b(\w+Handle)\s*>*(?:\s*,\s*\w+\s*>)*\s*[&*]?\s*(\w+)\s*[;,={(]")
METHOD = re.compile(r"(?<![\w.>])(?:\w+\s*::\s*)?(" + "|".join(LIFE_CYCLE) + r")\s*\([^;{}]*\)[^;{}]*\{")
CALLBACK = re.compile(r"&\s*(?:\w+\s*::\s*)*(\w+)\s*[,)]")
STATE = re.compile(r"\b(?:RobotState|(?:auto(?=[^;]*getRobotState\s*\(\s*\)\s*;)))\s*&?\s+&?(\w+)\s*[=;,)({]")
ELEMENT = re.compile(r"\bfor\s*\([^;:()]*\b(\w+)\s*:\s*(\w+)\s*\)")
RENAMED = re.compile(r"\bauto\s*[&*]?\s*(\w+)\s*=\s*[*&(]*(\w+)\b")
GOT = re.compile(r"\bauto\s*[&*]?\s*(\w+)\s*=[^;]*getHandle\s*\([^;()]*\)\s*;")
CHAINED = re.compile(r"getHandle\s*\([^;()]*\)\s*\.\s*(\w+)\s*\(")
LIBRARY = re.compile(
    r"\b((?:control_toolbox|tf2_ros|tf|message_filters|interactive_markers|urdf|KDL|pinocchio|moveit\w*)::\w+|ros::\w*Timer)\b"
)
NAMED = {"parameter", "subscriber", "publisher", "service", "service client"}
"""Kinds of uses with a name that the source may compute."""
OF_VECTORS = {
    "push_back",
    "emplace_back",
    "size",
    "resize",
    "reserve",
    "reset",
    "get",
    "at",
    "clear",
    "begin",
    "end",
    "empty",
}
"""Methods of C++ containers and pointers of handles, which are no calls to the robot."""


@dataclass(frozen=True, order=True)
class Use:
    """Something of ROS or of the robot that a controller uses.

    Attributes:
        kind: "interface", "parameter", "subscriber", "publisher", "service", "service client", "action", "live
            parameters", "call", "state", "library" (of C++) or "module" (of Python, which is missing here).
        name: name in the source: of the interface, parameter, topic, service, method or field.
        type: message type as "package/Name", class of the handle, or default of a parameter as written; may be empty.
        origin: file name and line of the first use.
        node: argument of `Controller.init` to whose namespace the name is relative.
    """

    kind: str
    name: str
    type: str
    origin: str
    node: str = "controller_node"

    @property
    def is_literal(self) -> bool:
        """False if the source computes the name, which is then the expression in parentheses."""
        return not self.name.startswith("(")


@dataclass(frozen=True)
class _Nodes:
    """Node handles of a source.

    Attributes:
        children: parent (may be empty) and relative namespace of each handle with a namespace of its own.
        root: handle of the controller manager's namespace, the first of two that `init` has; may be empty.
    """

    children: dict[str, tuple[str, str]]
    root: str

    @classmethod
    def of(cls, whole: str) -> "_Nodes":
        """Return the node handles in the text of all files."""
        two = TWO_NODES.search(whole)
        children = {child: (parent, space) for child, parent, space in CHILD_NODE.findall(whole) if child != parent}
        return cls(children, two.group(1) if two else "")

    def resolve(self, use: Use, handle: str) -> Use:
        """Return the use of a name that is relative to the namespace of a node handle."""
        name, met = use.name, set()
        while handle in self.children and handle not in met and name[:1] not in {"/", "~", "("}:
            met.add(handle)
            handle, space = self.children[handle]
            name = f"{space}/{name}"
        root = bool(self.root) and handle == self.root
        return replace(use, name=name, node="root_node" if root else use.node)


@dataclass(frozen=True)
class Source:
    """Controller as read from its source.

    Attributes:
        name: name of the class.
        plugin: name of the plugin, "package/Class"; the class alone if the source does not export it.
        uses: what it uses, each once, by kind and in the order of the source.
        methods: lines of each method of the life cycle, as "FILE, lines A to B".
        others: other classes of controllers in the files; `uses` contains theirs, too.
    """

    name: str
    plugin: str
    uses: tuple[Use, ...]
    methods: dict[str, str]
    others: tuple[str, ...] = ()


def read_cpp(files: Sequence[Path]) -> Source:
    """Return the controller in C++ files; headers that the files include are read, too, where they can be located.

    Raises:
        HricError: a file cannot be read, or no file has a class of a controller.
    """
    texts = {path: _text(path) for path in files}
    folders = [folder for path in files for folder in (path.parent / "include", path.parent.parent / "include")]
    waiting = list(files)
    while waiting:
        path = waiting.pop()
        for header in _headers(path, texts[path], folders):
            if header not in texts:
                texts[header] = _text(header)
                waiting.append(header)
    packages = {Path(name).stem: name.split("/")[0] for text in texts.values() for name in INCLUDE.findall(text)}
    aliases = dict(one for text in texts.values() for one in ALIAS.findall(text))
    texts = {path: _full(INCLUDE.sub("", text), aliases) for path, text in texts.items()}
    whole = "\n".join(texts.values())
    if "rclcpp" in whole:
        raise HricError(f"{files[0].name} is written for ROS 2 (rclcpp); valid: a controller of ros_control, ROS 1")
    exported, declared = EXPORT.search(whole), CLASS.search(whole)
    if exported is None and declared is None:
        raise HricError(
            f"{', '.join(path.name for path in files)}: no class is derived from controller_interface::Controller or "
            "MultiInterfaceController, and none is exported by PLUGINLIB_EXPORT_CLASS; give the file with the class"
        )
    plugin = exported.group(1).replace("::", "/", 1) if exported else declared.group(1) if declared else ""
    name = plugin.rpartition("/")[2].rpartition(":")[2]
    found_names = {one.rpartition(":")[2] for one in (*EXPORT.findall(whole), *CLASS.findall(whole))}
    uses: dict[tuple[str, str], Use] = {}
    methods: dict[str, str] = {}
    for path, text in texts.items():
        for use in _uses(path, text, whole):
            if use.kind in {"subscriber", "publisher", "service"} and use.type in packages:  # a name of "using"
                use = replace(use, type=f"{packages[use.type]}/{use.type}")
            uses.setdefault((use.kind, use.name), use)
        for found in METHOD.finditer(text):
            first, last = _line(text, found.start(1)), _line(text, _block_end(text, found.end() - 1))
            methods.setdefault(found.group(1), f"{path.name}, lines {first} to {last}")
    return Source(name, plugin, tuple(uses.values()), methods, tuple(sorted(found_names - {name})))


def _text(path: Path) -> str:
    """Return the text of a file, without comments but with all its line breaks."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise HricError(f"{path}: {error.strerror}") from None
    return COMMENTS.sub(lambda one: one.group() if one.group()[0] == '"' else re.sub(r"[^\n]", " ", one.group()), text)


def _full(text: str, aliases: Mapping[str, str]) -> str:
    """Return the text with the full names of aliased namespaces."""
    for short, full in aliases.items():
        text = re.sub(rf"(?<![\w:]){short}::", f"{full}::", text)
    return text


def _headers(path: Path, text: str, folders: Sequence[Path]) -> Iterator[Path]:
    """Yield the headers that a file includes and that are beside it or in one of the folders."""
    for name in INCLUDE.findall(text):
        if header := next((one for folder in (path.parent, *folders) if (one := folder / name).is_file()), None):
            yield header


def _line(text: str, position: int) -> int:
    return text.count("\n", 0, position) + 1


def _block_end(text: str, opening: int) -> int:
    """Return the position of the brace that closes the one at `opening`, or of the last character."""
    depth = 0
    for position in range(opening, len(text)):
        depth += {"{": 1, "}": -1}.get(text[position], 0)
        if depth == 0:
            return position
    return len(text) - 1


def _uses(path: Path, text: str, whole: str) -> Iterator[Use]:
    """Yield what a file uses; `whole` is the text of all files, for types that another one declares."""
    nodes = _Nodes.of(whole)

    def at(kind: str, name: str, of: str, found: re.Match[str], handle: str | None = None) -> Use:
        if kind in NAMED:
            name = _label(name)
        return nodes.resolve(Use(kind, name, of, f"{path.name}:{_line(text, found.start())}"), handle or "")

    for found in INTERFACE.finditer(text):
        if not found.group(1).startswith("controller_interface"):
            yield at("interface", found.group(1), "", found)
    for found in UNQUALIFIED.finditer(text):
        space = "franka_hw" if found.group(1).startswith("Franka") else "hardware_interface"
        if re.search(rf"\busing\s+namespace\s+{space}\s*;", whole):
            yield at("interface", f"{space}::{found.group(1)}", "", found)
    for found in PARAMETER.finditer(text):
        name, default = _parameter(found.group(2) or "get", _arguments(text, found.end() - 1))
        yield at("parameter", name, default, found, found.group(1))
    yield from _topics(text, whole, at)
    for found in SERVICE.finditer(text):
        of = re.sub("/(Request|Response)$", "", _message(found.group(3), text, found.end(), whole))
        kind = "service" if found.group(2) == "advertiseService" else "service client"
        yield at(kind, found.group(4), of, found, found.group(1))
    for found in ACTION.finditer(text):
        yield at("action", _ros_type(found.group(2)), found.group(1).lower(), found)
    for found in LIVE.finditer(text):
        yield at("live parameters", _ros_type(found.group(1)), "", found)
    yield from _calls(text, whole, at)
    for found in LIBRARY.finditer(text):
        yield at("library", found.group(1), "", found)


def _calls(text: str, whole: str, at: Callable[..., Use]) -> Iterator[Use]:
    """Yield the calls of handles in a file, and the fields of the Franka state that it reads."""
    handles = {variable: kind for kind, variable in HANDLE.findall(whole) if kind != "NodeHandle"}
    handles |= {variable: "handle" for variable in GOT.findall(whole)}
    for pattern in (ELEMENT, RENAMED):
        handles |= {one: handles[group] for one, group in pattern.findall(whole) if group in handles}
    for found in re.finditer(r"\b(\w+)(?:\s*\[[^\]]*\]|\.at\([^)]*\))?\)?\s*(?:\.|->)\s*(\w+)\s*\(", text):
        if found.group(1) in handles and found.group(2) not in OF_VECTORS:
            yield at("call", found.group(2), handles[found.group(1)], found)
    for found in CHAINED.finditer(text):
        yield at("call", found.group(1), "handle", found)
    states = "|".join({r"getRobotState\(\)", *(rf"\b{name}" for name in STATE.findall(whole))})
    for found in re.finditer(rf"(?:{states})\s*\.\s*(\w+)\b(?!\s*\()", text):
        yield at("state", found.group(1), "", found)


def _topics(text: str, whole: str, at: Callable[..., Use]) -> Iterator[Use]:
    """Yield the subscribers and publishers of a file."""
    for pattern in (SUBSCRIPTION, SUBSCRIBE_OPTIONS):
        for found in pattern.finditer(text):
            kind = _message(found.group(2), text, found.end(), whole)
            yield at("subscriber", found.group(3), kind, found, found.group(1))
    for found in ADVERTISED.finditer(text):
        yield at("publisher", found.group(3), _ros_type(found.group(2)), found, found.group(1))
    variables = {variable: _ros_type(kind) for kind, variable, *_ in REALTIME.findall(whole) if variable}
    for found in REALTIME.finditer(text):
        if found.group(4):
            yield at("publisher", found.group(4), _ros_type(found.group(1)), found, found.group(3))
    for found in REALTIME_INIT.finditer(text):
        yield at("publisher", found.group(3), variables.get(found.group(1), ""), found, found.group(2))


def _message(stated: str | None, text: str, begin: int, whole: str) -> str:
    """Return the message type of a subscriber: as stated, or that of its callback's argument; empty: not known."""
    if stated:
        return _ros_type(stated)
    callback = CALLBACK.search(text[begin : text.find(";", begin)])
    name = callback.group(1) if callback else "callback"
    argument = re.search(rf"\b{name}\s*\(\s*(?:const\s+)?{TYPE}", whole)
    return _ros_type(argument.group(1)) if argument else ""


def _ros_type(name: str) -> str:
    """Return a C++ type of a message as "package/Name"."""
    name = re.sub(r"\s|ConstPtr$|Ptr$", "", name).removesuffix("::").removeprefix("::")
    return name.replace("::", "/")


def _arguments(text: str, opening: int) -> list[str]:
    """Return the arguments between the parenthesis at `opening` and its counterpart."""
    parts, depth, part = [], 0, ""
    for one in text[opening + 1 : opening + 600]:
        depth += {"(": 1, "{": 1, "[": 1, ")": -1, "}": -1, "]": -1}.get(one, 0)
        if depth < 0:
            break
        if one == "," and depth == 0:
            parts.append(part.strip())
            part = ""
        else:
            part += one
    return [*parts, part.strip()]


def _parameter(call: str, arguments: Sequence[str]) -> tuple[str, str]:
    """Return the expression of the name and the default (empty: none) of a parameter read by `call`."""
    default = "" if call != "param" or len(arguments) < 2 else arguments[-1]
    return arguments[0], default


def _label(expression: str) -> str:
    """Return the text of a C++ string literal, or "(EXPRESSION)" if the name is computed."""
    expression = expression.strip()
    literal = re.fullmatch(rf"(?:(?:std::)?string\s*[({{]\s*)?{TEXT}\s*[)}}]?", expression)
    return literal.group(1) if literal else f"({expression})"
