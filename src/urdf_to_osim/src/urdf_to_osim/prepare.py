"""Decisions before a model is built: names, inertias, and which links become bodies."""

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
# Components that every body, joint or model has.
RESERVED = ("ground", "frame_geometry", "wrapobjectset", "components", "..", ".")


@dataclass(frozen=True)
class ConversionPlan:
    """Description ready to be built.

    Attributes:
        described: the unchanged description.
        robot: description with settled inertias.
        links, joints: names of the description -> names in OpenSim.
        bodies: links that become bodies; the others are frames.
        masses: mass properties of the bodies, in axes of the link; bodies without mass have none. The sum over links
            that are fixed to each other is that of `robot`.
        notes: repairs, kept faults, renamings, and the smoothing of friction.
        friction_velocities: v of Coulomb friction, -f tanh(dq/v), for each joint that has it [rad/s or m/s].
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
        """True if the mass properties of a link differ from the description."""
        return any(link.mass is not self.described.links[name].mass for name, link in self.robot.links.items())


def prepare(robot: Robot, options: Options) -> ConversionPlan:
    """Decide names, inertias and bodies.

    Raises:
        DescriptionError: an inertia or a name that must be corrected; names the element and a remedy.
        UnknownNameError: friction parameters of a joint that does not exist or does not have exactly one coordinate.
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
    """Return a map from names to unique names that OpenSim allows; `choice` is "refuse" or "rename".

    Raises:
        DescriptionError: a forbidden name that may not be changed.
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
    """Refuse coordinate names that two joints share, since forces find coordinates by name."""
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
        return "it is one of its own"
    characters = sorted(set(ILLEGAL.findall(name)))
    return f"it contains {' '.join(map(repr, characters))}" if characters else ""


def _free(wish: str, taken: set[str]) -> str:
    candidate, number = wish, 2
    while candidate in taken:
        candidate, number = f"{wish}_{number}", number + 1
    return candidate


def _join_faulty(robot: Robot, options: Options, notes: list[str]) -> dict[str, MassProperties | None]:
    """Return masses joined in the topmost of fixed links, if one is physically impossible alone but not their sum."""
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
        notes.append(note or f"link {', '.join(faulty)}: no body, but one with what it is fixed to; {top} has it all")
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
    """Return why OpenSim cannot hold a moved link without mass; empty: a link fixed to it or the next one has mass."""
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
            f"joint {joint.name} moves it, and neither it nor the link that follows has mass, which OpenSim cannot hold"
        )
    return f"joint {joint.name} moves it, but it and what is fixed to it have no mass"


def _has_mass(link: Link) -> bool:
    return link.mass is not None and link.mass.mass > 0.0


MOSTLY = 0.5
"""Fraction [1] that counts as most of a joint's inertia, or of a robot's joints (project default, unconfirmed)."""
NAMED = 5
"""Maximum number of joints that a refusal names."""


def invented_joints(described: Robot, repaired: Robot) -> list[str]:
    """Return the joints most of whose inertia, by the mass matrix over `poses`, is not in the description."""
    trees = Tree(described), Tree(repaired)
    sums = np.sum([[np.diag(tree.mass_matrix(tree.positions(q))) for tree in trees] for q in poses(described)], axis=0)
    rows = zip(trees[0].joints, *sums, strict=True)
    return list(dict.fromkeys(name for name, old, new in rows if new - old > MOSTLY * new))


def check_invented(described: Robot, repaired: Robot) -> None:
    """Refuse a robot whose motion depends mostly on invented inertia.

    Raises:
        DescriptionError: most joints move mostly invented inertia; names some, and a remedy.
    """
    moving = [joint for joint in repaired.joints.values() if joint.type != "fixed"]
    invented = invented_joints(described, repaired) if moving else []
    if len(invented) > MOSTLY * len(moving):
        named = ", ".join(invented[:NAMED]) + (", ..." if len(invented) > NAMED else "")
        raise DescriptionError(
            f"the mass of robot {repaired.name} would mostly be invented: {len(invented)} of {len(moving)} joints "
            f"({named}) move more of it than the "
            "description has; give the links an <inertial>, or convert with inertia invent"
        )
