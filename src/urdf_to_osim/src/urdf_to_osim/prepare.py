"""Decisions before an OpenSim model is built: names, inertias, and which links become bodies."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from hric_control.plants.models import moving_body
from hric_core.errors import DescriptionError, UnknownNameError
from hric_core.geometry import MassProperties
from hric_core.urdf import ONE_COORDINATE, Joint, Link, Robot
from hric_dynamics.tree import Tree
from urdf_to_osim import friction, inertia
from urdf_to_osim.joints import coordinate_names
from urdf_to_osim.min_inertias import poses
from urdf_to_osim.options import Options

# Separators and wildcards of component paths in OpenSim, and white space.
ILLEGAL = re.compile(r"[/\\*+\s]")
REPAIRING = ("repair", "invent")
# Names of components that every OpenSim body, joint or model has already.
RESERVED = ("ground", "frame_geometry", "wrapobjectset", "components", "..", ".")


@dataclass(frozen=True)
class ConversionPlan:
    """Decisions about a robot description from which the OpenSim model is built.

    Attributes:
        described: unchanged description.
        robot: description with the inertias to use.
        links, joints: names in OpenSim, by the names in the description.
        bodies: links that become bodies; the others become frames.
        masses: mass properties of the bodies, in axes of the link; bodies without mass are left out. They may be
            distributed among links that are fixed to each other in another way than in `robot`, with the same sum.
        notes: texts about repairs, kept faults, renamings, and the smoothing of friction.
        friction_velocities: transition velocity v of Coulomb friction -f tanh(dq/v) [rad/s or m/s], by joint with
            friction.
    """

    described: Robot
    robot: Robot
    links: dict[str, str]
    joints: dict[str, str]
    bodies: frozenset[str]
    masses: dict[str, MassProperties]
    notes: tuple[str, ...]
    friction_velocities: dict[str, float]

    @property
    def repaired(self) -> bool:
        """True if the mass properties of any link differ from the description."""
        return any(link.mass is not self.described.links[name].mass for name, link in self.robot.links.items())


def prepare(robot: Robot, options: Options) -> ConversionPlan:
    """Decide on the names, inertias and bodies of the OpenSim model.

    Raises:
        DescriptionError: the user must correct an inertia or a name; the text says where and how.
        UnknownNameError: friction parameters are given for a joint that does not exist or does not have exactly one
            coordinate.
    """
    notes: list[str] = []
    links = legal_names("link", robot.links, options.names, notes)
    joints = legal_names("joint", robot.joints, options.names, notes)
    _check_friction(robot, options)
    _check_coordinates(robot, joints)
    joined = _join_faulty(robot, options, notes)
    settled = _settle_inertias(robot, options, joined, notes)
    moved = {joint.child for joint in robot.joints.values() if joint.type != "fixed"}
    masses = {name: link.mass for name, link in settled.links.items()} | joined
    with_mass = {name: mass for name, mass in masses.items() if mass is not None and mass.mass > 0.0}
    bodies = frozenset(moved | set(with_mass))
    velocities = friction.transition_velocities(settled, options)
    notes += [friction.note(velocities)] if velocities else []
    return ConversionPlan(robot, settled, links, joints, bodies, with_mass, tuple(notes), velocities)


def legal_names(kind: str, names: Iterable[str], choice: str, notes: list[str]) -> dict[str, str]:
    """Return unique names that OpenSim allows, by the names of the description.

    Args:
        kind: "link" or "joint", for messages.
        names: names in the description.
        choice: "refuse" or "rename" names that OpenSim forbids.
        notes: list to which texts about renamings are added.

    Raises:
        DescriptionError: a name is forbidden and may not be changed.
    """
    names = list(names)
    taken = {name for name in names if not _illegal(name)}
    legal: dict[str, str] = {}
    for name in names:
        if not (reason := _illegal(name)):
            legal[name] = name
            continue
        if choice == "refuse":
            raise DescriptionError(
                f"{kind} {name!r}: OpenSim forbids the name ({reason}); rename it, or convert with names rename"
            )
        legal[name] = _free(f"{name}_{kind}" if name in RESERVED else ILLEGAL.sub("_", name), taken)
        taken.add(legal[name])
        notes.append(f"{kind} {name!r}: renamed to {legal[name]}, since {reason}")
    return legal


def _check_friction(robot: Robot, options: Options) -> None:
    single = [joint.name for joint in robot.joints.values() if joint.type in ONE_COORDINATE]
    for name in options.friction_parameters:
        if name not in single:
            raise UnknownNameError("joint", name, single, "friction_parameters")


def _check_coordinates(robot: Robot, names: dict[str, str]) -> None:
    """Raise an error if two joints have a coordinate of the same name, since forces find coordinates by name."""
    owner: dict[str, str] = {}
    for joint in robot.joints.values():
        for coordinate in coordinate_names(joint, names[joint.name]):
            if coordinate in owner:
                raise DescriptionError(
                    f"joint {joint.name}: its coordinate {coordinate} is also one of joint {owner[coordinate]}; "
                    "rename one of them"
                )
            owner[coordinate] = joint.name


def _illegal(name: str) -> str:
    if name in RESERVED:
        return "OpenSim uses it itself"
    characters = sorted(set(ILLEGAL.findall(name)))
    return f"it contains {' '.join(map(repr, characters))}" if characters else ""


def _free(wish: str, taken: set[str]) -> str:
    candidate, number = wish, 2
    while candidate in taken:
        candidate, number = f"{wish}_{number}", number + 1
    return candidate


def _join_faulty(robot: Robot, options: Options, notes: list[str]) -> dict[str, MassProperties | None]:
    """Return masses of rigidly connected links that must be combined, by link; the topmost link gets the sum.

    Links are combined if one of them has a physically impossible inertia, but their sum is possible.
    """
    clusters: dict[str, dict[str, MassProperties]] = {}
    for name, (top, T_top_link) in robot.rigid_groups().items():
        cluster, mass = clusters.setdefault(top, {}), robot.links[name].mass
        if mass is not None and (mass.mass > 0.0 or mass.inertia.any()):
            cluster[name] = mass.moved(T_top_link)
    joined: dict[str, MassProperties | None] = {}
    for top, members in clusters.items():
        faulty = [name for name, mass in members.items() if inertia.fault(mass)]
        if not faulty or set(members) == {top}:
            continue
        total = reduce(add, members.values())
        if inertia.fault(total) and options.inertia != "keep":
            continue
        total, note = inertia.settled(top, total, options.inertia)
        joined |= dict.fromkeys(members) | {top: total}
        notes.append(
            note
            or f"link {', '.join(faulty)}: its inertia is impossible, but possible together with the links fixed to "
            f"it; link {top} has the sum"
        )
    return joined


def _settle_inertias(
    robot: Robot, options: Options, joined: Mapping[str, MassProperties | None], notes: list[str]
) -> Robot:
    links = dict(robot.links)
    for name, link in robot.links.items():
        if link.mass is not None and name not in joined:
            mass, note = inertia.settled(name, link.mass, options.inertia)
            links[name] = replace(link, mass=mass)
            notes += [note] if note else []
    # From the leaves inwards, since the mass of a link counts for its parent.
    for joint in reversed(robot.joints.values()):
        reason = "" if joint.type == "fixed" else _carries_nothing(joint, robot.joints.values(), links)
        if reason and options.inertia == "keep":
            links[joint.child] = replace(links[joint.child], mass=moving_body(robot, joint.child, MassProperties()))
        elif reason and options.inertia not in REPAIRING:
            raise DescriptionError(
                f"link {joint.child}: {reason}; give it an <inertial>, make the joint fixed, or convert with "
                "inertia repair"
            )
        elif reason:
            links[joint.child] = replace(links[joint.child], mass=inertia.MINIMUM)
            notes.append(
                f"link {joint.child}: {reason}; it got {inertia.MIN_MASS:g} kg and {inertia.MIN_INERTIA:g} kg m^2"
            )
    settled = replace(robot, links=links)
    if options.inertia == "repair" and notes:
        # A tensor moved to the nearest physical one is not invented; one without a value in the description is.
        nothing = {
            name: link for name, link in robot.links.items() if link.mass is None or inertia.says_nothing(link.mass)
        }
        check_invented(replace(robot, links=links | nothing), settled)
    return settled


def _carries_nothing(joint: Joint, joints: Iterable[Joint], links: dict[str, Link]) -> str:
    """Return why OpenSim cannot simulate the child link of a joint, which has no mass; empty if it can.

    It can if a link fixed to the child, or the next moving link, has mass.
    """
    joints = list(joints)
    group, followed = [joint.child], False
    for name in group:
        if _has_mass(links[name]):
            return ""
        outboard = [other for other in joints if other.parent == name]
        if any(other.type != "fixed" and _has_mass(links[other.child]) for other in outboard):
            return ""
        followed = followed or any(other.type != "fixed" for other in outboard)
        group += [other.child for other in outboard if other.type == "fixed"]
    if followed:
        return (
            f"joint {joint.name} moves it, and neither it nor the link that follows has mass, which OpenSim cannot "
            "simulate"
        )
    return f"joint {joint.name} moves it, but it and what is fixed to it have no mass"


def _has_mass(link: Link) -> bool:
    return link.mass is not None and link.mass.mass > 0.0


MOSTLY = 0.5
"""Fraction [1] that counts as most of a joint's inertia, or of a robot's joints (project default, unconfirmed)."""
NAMED = 5
"""Maximum number of joints that an error message names."""


def invented_joints(described: Robot, repaired: Robot) -> list[str]:
    """Return the names of the joints whose inertia is mostly invented, i.e. added by the repair.

    The inertia of a joint is its diagonal element of the mass matrix, summed over some random poses.
    """
    trees = Tree(described), Tree(repaired)
    sums = np.sum([[np.diag(tree.mass_matrix(tree.positions(q))) for tree in trees] for q in poses(described)], axis=0)
    rows = zip(trees[0].joints, *sums, strict=True)
    return list(dict.fromkeys(name for name, old, new in rows if new - old > MOSTLY * new))


def check_invented(described: Robot, repaired: Robot) -> None:
    """Raise an error if the motion of the repaired robot depends mostly on invented inertia.

    Raises:
        DescriptionError: the inertia of most joints is mostly invented; the text names some, and says what to do.
    """
    moving = [joint for joint in repaired.joints.values() if joint.type != "fixed"]
    invented = invented_joints(described, repaired) if moving else []
    if len(invented) > MOSTLY * len(moving):
        named = ", ".join(invented[:NAMED]) + (", ..." if len(invented) > NAMED else "")
        raise DescriptionError(
            f"the mass of robot {repaired.name} would mostly be invented: {len(invented)} of {len(moving)} joints "
            f"({named}) would move more invented inertia than described one; give the links an <inertial>, or convert "
            "with inertia invent"
        )
