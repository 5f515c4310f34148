"""Skeleton of a ported controller: a package with the life cycle, interfaces, parameters and topics of the source."""

import keyword
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from hric_controllers.porting.counterparts import counterpart
from hric_controllers.porting.reading import Source, Use

TEMPLATE = Path(__file__).resolve().parents[3] / "templates/my_controller"
ARM = ", ".join(f"panda_joint{number}" for number in range(1, 8))
STATES = {"FrankaStateInterface", "FrankaPoseCartesianInterface", "FrankaVelocityCartesianInterface"}
IMPORTS = {"Controller": "hric_control.controller", "HricError": "hric_core.errors"}


def files(source: Source) -> dict[str, str]:
    """Return the text of each file of the package, by its path in the package's folder."""
    package = snake(source.name)
    texts = {}
    for path in sorted(TEMPLATE.rglob("*")):
        if path.is_file() and path.suffix not in {".py", ".pyc", ".yaml"}:
            name = path.relative_to(TEMPLATE).as_posix().replace("my_controller", package)
            texts[name] = _renamed(path.read_text(), source, package)
    texts[f"src/{package}/__init__.py"] = f'"""Port of {source.plugin}."""\n'
    texts[f"src/{package}/law.py"] = code(source)
    texts[f"config/{package}.yaml"] = configuration(source)
    return texts


def _renamed(text: str, source: Source, package: str) -> str:
    """Return the text of a template's file with the names of the ported package and controller."""
    text = text.replace("my_controller/JointSpring", source.plugin).replace(
        "joint_spring:JointSpring", f"law:{source.name}"
    )
    text = re.sub(r"Holds the joints[^<]*", f"Port of {source.plugin}.", text)
    return text.replace("My own controller.", f"Port of {source.plugin}.").replace("my_controller", package)


def snake(name: str) -> str:
    """Return a class name in snake case, as a name of a module or attribute."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|\W+", "_", name).strip("_").lower()
    return f"{words}_" if keyword.iskeyword(words) or not words[:1].isalpha() else words


def configuration(source: Source) -> str:
    """Return the YAML of the controller; values that the source does not give stay commented out."""
    lines = [f"{snake(source.name)}:", f"  type: {source.plugin}"]
    for use in _parameters(source):
        if use.node != "controller_node" or use.name.startswith("/"):
            continue
        known = {"arm_id": "panda", "joint_names": f"[{ARM}]", "joints": f"[{ARM}]"}.get(use.name)
        value = known or _literal(use.type)
        lines.append(f"  {use.name}: {value}" if value else f"  # {use.name}: value of your YAML; read in {use.origin}")
    return "\n".join(lines) + "\n"


def code(source: Source) -> str:
    """Return the controller's Python module: it gets what the source uses; its `update` raises an error, as a to-do."""
    names = dict(IMPORTS)
    body = list(_init(source, names))
    if any("realtime." in line for line in body):
        names["realtime"] = "hric_core"
    modules: dict[str, list[str]] = {}
    for name, module in names.items():
        modules.setdefault(module, []).append(name)
    law = source.methods.get("update", "the source")
    lines = [
        f'"""Port of {source.plugin}: interfaces, parameters and topics; the law is still to be written."""',
        "",
        *(f"from {module} import {', '.join(sorted(parts))}" for module, parts in sorted(modules.items())),
        "",
        "",
        f"class {source.name}(Controller):",
        '    """Describe the control law here."""',
        "",
        "    def init(self, robot_hw, root_node, controller_node):",
        f'        """Read parameters, get interfaces, open topics ({source.methods.get("init", "no source")})."""',
        *(f"        {line}" for line in body),
        "",
        "    def starting(self, time):",
        f'        """Prepare to run ({source.methods.get("starting", "not in the source")})."""',
        "",
        "    def update(self, time, period):",
        f'        """Compute and command, every millisecond ({law}); must not call ROS, open files or wait."""',
        *(f"        # {line}" for line in _hints(source)),
        f'        raise HricError("{source.name}: write the law of {law}")',
    ]
    if "stopping" in source.methods:
        lines += ["", "    def stopping(self, time):", f'        """Finish ({source.methods["stopping"]})."""']
    return "\n".join(lines) + "\n"


def _parameters(source: Source) -> list[Use]:
    """Return the parameters with a plain name, and those that the interfaces need."""
    uses = [replace(use, name=use.name.removeprefix("~")) for use in source.uses if use.kind == "parameter"]
    uses = [use for use in uses if use.is_literal and use.name]
    interfaces = {counterpart(use).text for use in source.uses if use.kind == "interface" and counterpart(use).exists}
    if any(name.startswith("Franka") for name in interfaces) and not any("arm_id" in use.name for use in uses):
        uses.append(Use("parameter", "arm_id", '"panda"', "no file"))
    if any("Joint" in name for name in interfaces) and not any("joint" in use.name for use in uses):
        uses.append(Use("parameter", "joints", "", "no file"))
    return uses


def _init(source: Source, names: dict[str, str]) -> Iterator[str]:
    """Yield the lines of `init`, and enter what they import into `names`."""
    parameters = _parameters(source)
    for use in parameters:
        default = _literal(use.type)
        yield f'self.{snake(use.name)} = {use.node}.param("{use.name}"{f", {default}" if default else ""})'
    joints = next((snake(use.name) for use in parameters if "joint" in use.name), "joints")
    arm = next((snake(use.name) for use in parameters if "arm_id" in use.name), "arm_id")
    for use in source.uses:
        here = counterpart(use)
        if (not here.exists and use.kind != "state") or not use.is_literal:
            yield f"# {use.origin}: {use.kind} {use.name}: {here.text}"
        elif use.kind == "interface":
            names[here.text] = here.module
            yield _interface(here.text, joints, arm)
        elif use.kind in {"subscriber", "publisher"}:
            names[here.text] = here.module
            yield from _topic(replace(use, name=use.name.removeprefix("~")), here.text)
        elif use.kind in {"service", "action", "live parameters"}:
            yield f"# {use.origin}: {use.kind} {use.name}: {here.text}"


def _interface(name: str, joints: str, arm: str) -> str:
    """Return the line that gets the handle of an interface."""
    got = f"robot_hw.get({name})"
    if name == "ForceTorqueSensorInterface":
        return f"self.sensors = [{got}.handle(name) for name in {got}.names]"
    if not name.startswith("Franka"):
        names = f"self.{joints}" if joints.endswith("s") else f"[self.{joints}]"
        return f"self.{snake(name.removesuffix('Interface'))} = {got}.group({names})"
    suffix = "model" if name == "FrankaModelInterface" else "robot"
    attribute = "robot_state" if name == "FrankaStateInterface" else snake(name.removesuffix("Interface"))
    return f'self.{attribute} = {got}.handle(f"{{self.{arm}}}_{suffix}")' + (
        ".robot_state" if attribute == "robot_state" else ""
    )


def _topic(use: Use, message: str) -> Iterator[str]:
    """Yield the lines that open a topic."""
    name = snake(use.name)
    if use.kind == "publisher":
        yield f'self.{name}_publisher = realtime.publisher({use.node}, "{use.name}", {message})'
        return
    yield f"self.new_{name} = realtime.LatestValue(None)"
    yield f'{use.node}.subscribe("{use.name}", {message}, self.new_{name}.set, queue_size=1)'


def _hints(source: Source) -> Iterator[str]:
    """Yield what the law uses of the handles and of the state, with its name here."""
    for use in source.uses:
        if use.kind == "call":
            yield f"{use.origin}: {use.type}::{use.name}: {counterpart(use).text}"
    fields = [use.name for use in source.uses if use.kind == "state" and counterpart(use).exists]
    if fields:
        yield f"fields of the state: {', '.join(fields)}"


def _literal(text: str) -> str:
    """Return a C++ or Python literal as Python and YAML read it; empty: it is not a literal."""
    text = re.sub(r'^(?:std::)?string\s*[({]\s*(".*")\s*[)}]$', r"\1", text)
    if re.fullmatch(r"-?\d+(\.\d*)?(e-?\d+)?f?", text):
        return text.removesuffix("f").removesuffix(".") if "." in text or text.isdigit() or text[0] == "-" else text
    if text in {"true", "True"}:
        return "True"
    if text in {"false", "False"}:
        return "False"
    return text if re.fullmatch(r'"[^"\\]*"|\'[^\'\\]*\'', text) else ""
