"""Realism of the simulated arm: sensor noise, and masses and friction that differ from the control box's model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast
from xml.etree import ElementTree

import numpy as np

import panda_description
from franka_sim.box.config import Vector, read_config
from hric_control.plants import BREAKAWAY, PHI, sigmoid_parameters
from hric_core.errors import UnknownNameError
from hric_core.node import REQUIRED
from hric_core.parameters import Settings, choice, declared, number, numbers, per_joint, whole
from hric_core.urdf import elements

JOINTS = 7
MAX_MASS_ERROR = 0.3
"""Maximum standard deviation of a link's mass, as a fraction [1]; CUT_OFF of them still leave a tenth of the mass."""
CUT_OFF = 3.0
"""Maximum deviation of mass and centre of mass [standard deviations]."""
IDEAL = "ideal"


@dataclass(frozen=True)
class Realism(Settings):
    """Differences between the simulated arm and the control box's model of it; config/realism.yaml explains them.

    Values per joint are 7 floats.
    """

    q_noise: Vector = per_joint(number(minimum=0.0, unit="rad"))
    dq_noise: Vector = per_joint(number(minimum=0.0, unit="rad/s"))
    tau_J_noise: Vector = per_joint(number(minimum=0.0, unit="N m"))
    wrench_noise: Vector = numbers(6, minimum=0.0, unit="N, N m")
    mass_error: Vector = per_joint(number(minimum=0.0, maximum=MAX_MASS_ERROR))
    com_error: Vector = per_joint(number(minimum=0.0, unit="m"))
    body_seed: int = whole(minimum=0)
    friction: str = choice("none", "identified", default=REQUIRED)
    friction_known: Vector = per_joint(number(minimum=0.0))
    breakaway: Vector = per_joint(number(minimum=0.0, unit="N m"))

    @property
    def noisy(self) -> bool:
        """True if any sensor or estimate has noise."""
        return any((*self.q_noise, *self.dq_noise, *self.tau_J_noise, *self.wrench_noise))

    def body(self, urdf_xml: str, arm_id: str) -> str:
        """Return the robot description for the plant: the control box's, with errors of masses and centres of mass.

        Without inertial errors it is returned unchanged.

        Args:
            urdf_xml: robot description that the control box uses.
            arm_id: prefix of the arm's links.
        """
        if not any((*self.mass_error, *self.com_error)):
            return urdf_xml
        draws = np.clip(np.random.default_rng(self.body_seed).standard_normal((JOINTS, 4)), -CUT_OFF, CUT_OFF)
        root = elements.parse(urdf_xml)
        links = {link.get("name"): link for link in root.iterfind("link")}
        for i, (mass_error, com_error, draw) in enumerate(
            zip(self.mass_error, self.com_error, draws, strict=True), start=1
        ):
            inertial = links[f"{arm_id}_link{i}"].find("inertial")
            if inertial is not None:
                _change(inertial, 1.0 + mass_error * draw[0], com_error * draw[1:])
        return ElementTree.tostring(root, encoding="unicode")

    def with_friction(self, plant: Mapping[str, object], arm_id: str) -> dict[str, object]:
        """Return the plant's parameters, completed with the friction of this arm.

        If friction is "identified", missing parameters get the published values, and a missing breakaway torque gets
        this arm's.

        Args:
            plant: parameters of the plant.
            arm_id: prefix of the joints.
        """
        config = dict(plant)
        if "friction" not in config and self.friction != "none":
            config["friction"] = self.friction
        if config.get("friction") == "identified" and not config.get("friction_parameters"):
            config["friction_parameters"] = panda_description.friction_parameters(arm_id)
        if config.get("friction") == "identified" and any(self.breakaway):
            config["friction_parameters"] = self._with_breakaway(config["friction_parameters"], arm_id)
        return config

    def _with_breakaway(self, parameters: Any, arm_id: str) -> Any:
        """Return the friction parameters; joints without a breakaway torque get this arm's."""
        breakaway = dict(zip((f"{arm_id}_joint{i}" for i in range(1, JOINTS + 1)), self.breakaway, strict=True))
        if not breakaway.keys() & parameters.keys():
            return {BREAKAWAY: list(self.breakaway), **parameters}
        return {
            joint: {BREAKAWAY: breakaway[joint], **values} if joint in breakaway else values
            for joint, values in parameters.items()
        }

    def known_friction(
        self, plant: Mapping[str, object], joint_names: Sequence[str]
    ) -> Mapping[str, Mapping[str, float]] | None:
        """Return the friction that the control box compensates: phi1 [N m], phi2 [s/rad], phi3 [rad/s] by joint name.

        None if there is no friction, or the box knows none of it.

        Args:
            plant: parameters of the plant, after `with_friction`.
            joint_names: joints in order.
        """
        if plant.get("friction") != "identified" or not any(self.friction_known):
            return None
        parameters = cast(Mapping[str, Mapping[str, float]], plant["friction_parameters"])
        if all(share == 1.0 for share in self.friction_known):
            return parameters
        acting = sigmoid_parameters(parameters, joint_names)
        return {
            name: dict(zip(PHI, (share * phi[0], *phi[1:]), strict=True))
            for name, share, phi in zip(joint_names, self.friction_known, acting, strict=True)
        }


def _change(inertial: ElementTree.Element, factor: float, offset: Sequence[float]) -> None:
    """Multiply mass and inertia of a link by a factor, and move its centre of mass [m]."""
    origin = inertial.find("origin")
    if origin is None:
        origin = ElementTree.SubElement(inertial, "origin")
    centre = [float(x) + float(d) for x, d in zip(origin.get("xyz", "0 0 0").split(), offset, strict=True)]
    origin.set("xyz", " ".join(map(repr, centre)))
    for name in ("mass", "inertia"):
        for element in inertial.iterfind(name):
            element.attrib.update({key: repr(float(value) * float(factor)) for key, value in element.attrib.items()})


def presets() -> tuple[str, ...]:
    """Return the names of the presets of realism, e.g. "ideal" and "measured"."""
    return tuple(read_config("realism"))


def parse(value: Any, where: str) -> Realism:
    """Return the realism that the value of the parameter `realism` describes.

    Args:
        value: name of a preset, or a mapping with `preset` (ideal if absent) and the values that differ from it.
        where: full name of the parameter, for errors.

    Raises:
        HricError: an unknown preset or key, or an invalid value; lists the valid ones.
    """
    values = dict(value) if isinstance(value, Mapping) else {"preset": value}
    name = values.pop("preset", IDEAL)
    if not isinstance(name, str) or name not in presets():
        raise UnknownNameError("preset", name, presets(), where)
    valid = list(declared(Realism))
    for key in values:
        if key not in valid:
            raise UnknownNameError("value", key, ["preset", *valid], where)
    joints = [f"joint{number}" for number in range(1, JOINTS + 1)]
    return Realism.of({**read_config("realism")[name], **values}, f"{where}/", joints)
