"""Specification of a scene for MuJoCo's compiler: the robot, the models around it and the payloads.

Each cluster of rigidly connected links becomes one body with the sum of their masses. The pairs of shapes that may
touch are listed explicitly, since MuJoCo's own rules do not fit: they use the larger friction coefficient of two
surfaces, not the product, and do not exclude a neighbour link that is fixed to the world.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import combinations
from operator import add

import mujoco
import numpy as np

from hric_control.plant import Surface
from hric_control.plants import ContactLaw, Losses, Model, combine, never_touching
from hric_control.plants.faces import Solid
from hric_control.plants.models import moving_body
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, MassProperties, quaternion_from_rotation
from hric_core.meshes.canonical import hull_of
from hric_core.urdf import ONE_COORDINATE, Joint, Shape, mimic_laws, solids

_GEOMS = mujoco.mjtGeom
_HALF_LENGTHS: dict[str, Callable[[Sequence[float]], list[float]]] = {
    "sphere": lambda size: [size[0], 0.0, 0.0],
    "box": lambda size: [0.5 * edge for edge in size],
    "cylinder": lambda size: [size[0], 0.5 * size[1], 0.0],
    "capsule": lambda size: [size[0], 0.5 * size[1], 0.0],
    "plane": lambda size: [0.0, 0.0, 0.05],
}
"""Functions from URDF dimensions to MuJoCo's dimensions of a shape [m]; for a plane, the spacing of drawn lines."""
Law = tuple[ContactLaw, float]
"""Law of the normal force and friction coefficient [1] of penalty contact."""
MIMIC = 1.0
"""Value by which mimic.h recognises an equality constraint as a mimic law; MuJoCo does not use that entry."""
UNSOLVED = 1.0
"""Negative contact margin of a pair whose contacts MuJoCo reports but does not solve [m]; deeper than any overlap."""
SHORTEST = 1e-9
"""Minimum range of a joint with equal limits [rad or m]: MuJoCo refuses empty ranges (project default, unconfirmed)."""
LOOK_AHEAD = 5.0
"""Maximum approach speed at which links are found before they touch [m/s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class SceneFrame:
    """Position of a described link in the scene: the body to which it belongs, and the pose in it, shape (4, 4)."""

    body: str
    T_body_link: FloatArray


@dataclass(frozen=True)
class Geom:
    """Collision shape in the scene.

    Attributes:
        name: name of MuJoCo's geom.
        link: "model::link" to which the shape belongs.
        model: name of the model.
        body: name of the body to which the shape belongs.
        solid: shape in the body's frame, for penalty contact. (MuJoCo moves the frame of a mesh.)
    """

    name: str
    link: str
    model: str
    body: str
    solid: Solid


@dataclass
class SceneSpec:
    """Specification of a scene, with the information about it that MuJoCo's compiler does not need.

    Attributes:
        spec: specification for MuJoCo's compiler.
        frames: position of each link in the scene, by "model::link".
        geoms: all collision shapes, by name.
        moments: principal moments of the bodies with a physically impossible tensor, shape (3,) each [kg m^2]; to be
            set in the compiled model.
        springs: pairs of shapes with penalty contact, with their laws.
    """

    spec: mujoco.MjSpec
    frames: dict[str, SceneFrame] = field(default_factory=dict)
    geoms: dict[str, Geom] = field(default_factory=dict)
    moments: dict[str, FloatArray] = field(default_factory=dict)
    springs: list[tuple[Geom, Geom, Law]] = field(default_factory=list)


def quaternion(R: FloatArray) -> list[float]:
    """Return a rotation matrix, shape (3, 3), as a quaternion in MuJoCo's order w, x, y, z."""
    x, y, z, w = quaternion_from_rotation(R)
    return [w, x, y, z]


class Building:
    """Builder that adds models to the specification of a scene.

    Args:
        losses: rotor inertia, damping and friction of moving joints, by "model::joint".
        loads: payloads by "model::link", in the link's frame.

    Attributes:
        result: the scene so far.
    """

    def __init__(self, losses: Mapping[str, Losses], loads: Mapping[str, MassProperties]) -> None:
        self._losses, self._loads = losses, loads
        self.result = SceneSpec(mujoco.MjSpec())
        compiler = self.result.spec.compiler
        compiler.degree, compiler.boundmass, compiler.boundinertia = False, 0.0, 0.0
        compiler.balanceinertia = compiler.fusestatic = False

    def add(self, model: Model, *, stops: bool = False) -> None:
        """Add a model to the scene, with its root link at its start pose.

        Args:
            model: model to add.
            stops: True if MuJoCo stops the joints at the ends of their ranges.
        """
        tree, bodies = model.tree, {}
        clusters: dict[str, dict[str, FloatArray]] = {}
        for link, (top, T_top_link) in tree.rigid_groups().items():
            clusters.setdefault(top, {})[link] = T_top_link
            self.result.frames[f"{model.name}::{link}"] = SceneFrame(f"{model.name}::{top}", T_top_link)
        root = self._add_body(self.result.spec.worldbody, model, tree.root, model.T_world_start)
        bodies[tree.root] = root
        if not model.fixed:
            root.add_freejoint().name = model.free_joint
        self.fill(root, model, tree.root, clusters[tree.root], moving=not model.fixed)
        groups = tree.rigid_groups()
        for joint in tree.joints.values():
            if joint.type == "fixed":
                continue
            if joint.type not in ONE_COORDINATE:
                valid = ", ".join((*ONE_COORDINATE, "fixed"))
                raise DescriptionError(
                    f"joint {joint.name}: type {joint.type!r} is not supported by the MuJoCo plant; valid: {valid}"
                )
            top, T_top_parent = groups[joint.parent]
            body = self._add_body(bodies[top], model, joint.child, T_top_parent @ joint.T_parent_joint)
            bodies[joint.child] = body
            self._add_joint(body, model, joint, stops)
            self.fill(body, model, joint.child, clusters[joint.child], moving=True)
        for name, law in mimic_laws(tree.joints).items():
            follows = self.result.spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT,
                name1=f"{model.name}::{name}",
                name2=f"{model.name}::{law.joint}",
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
            )
            follows.data[:2], follows.data[-1] = [law.offset, law.multiplier], MIMIC

    @staticmethod
    def _add_body(parent: mujoco.MjsBody, model: Model, link: str, T: FloatArray) -> mujoco.MjsBody:
        return parent.add_body(name=f"{model.name}::{link}", pos=T[:3, 3], quat=quaternion(T[:3, :3]))

    def _add_joint(self, body: mujoco.MjsBody, model: Model, joint: Joint, stops: bool) -> None:
        name = f"{model.name}::{joint.name}"
        losses = self._losses.get(name, Losses())
        slides = joint.type == "prismatic"
        made = body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=joint.axis,
            armature=losses.rotor,
            damping=losses.damping,
            frictionloss=losses.coulomb,
            userdata=losses.sigmoid_row() if any(losses.sigmoid) else [],
        )
        bounded = stops and np.isfinite([joint.lower, joint.upper]).all()
        made.limited = mujoco.mjtLimited.mjLIMITED_TRUE if bounded else mujoco.mjtLimited.mjLIMITED_FALSE
        if bounded:
            made.range = [joint.lower, max(joint.upper, joint.lower + SHORTEST)]

    def fill(
        self, body: mujoco.MjsBody, model: Model, top: str, cluster: Mapping[str, FloatArray], *, moving: bool
    ) -> None:
        """Set mass and shapes of a body, which represents a cluster of rigidly connected links.

        Args:
            body: body of the cluster.
            model: model with the links.
            top: topmost link of the cluster, whose name the body has.
            cluster: poses of the links in the body, shape (4, 4) each.
            moving: True if the body can move, so that it needs a mass.
        """
        if moving:
            self._set_mass(body, model, top, cluster)
        for link, T_body_link in cluster.items():
            for number, shape in enumerate(solids(model.tree.links[link].collisions)):
                self._add_collision(body, model, link, number, shape, T_body_link @ shape.T_link_shape)
            if link in model.planes:
                plane = Shape(f"link {link}", "plane", (), np.eye(4))
                self._add_collision(body, model, link, 0, plane, T_body_link)

    def _set_mass(self, body: mujoco.MjsBody, model: Model, top: str, cluster: Mapping[str, FloatArray]) -> None:
        members = [
            part.moved(T)
            for link, T in cluster.items()
            for part in (model.tree.links[link].mass, self._loads.get(f"{model.name}::{link}"))
            if part is not None and (part.mass > 0.0 or part.inertia.any())
        ]
        mass = moving_body(model.tree, top, reduce(add, members, MassProperties()))
        moments, R = mass.principal()
        low, middle, high = sorted(moments)
        body.explicitinertial = True
        body.mass, body.ipos, body.iquat, body.inertia = mass.mass, mass.com, quaternion(R), moments
        if low <= 0.0 or low + middle < high:  # replaced by a sphere's until the compiled model gets the exact ones
            body.inertia = np.full(3, max(abs(high), abs(low)))
            self.result.moments[body.name] = moments

    def add_shape(
        self, body: mujoco.MjsBody, name: str, shape: Shape, T_body_geom: FloatArray, mesh: str = ""
    ) -> mujoco.MjsGeom:
        """Add a shape to a body as a MuJoCo geom without mass and contact, and return it.

        Args:
            body: body that gets the shape.
            name: name of the geom.
            shape: shape; its dimensions are not used if `mesh` is set.
            T_body_geom: pose in the body, shape (4, 4).
            mesh: name of a mesh that was added to the scene; empty: the shape is no mesh.
        """
        geom = body.add_geom(
            name=name,
            type=getattr(_GEOMS, f"mjGEOM_{shape.kind.upper()}"),
            pos=T_body_geom[:3, 3],
            quat=quaternion(T_body_geom[:3, :3]),
            density=0.0,
            contype=0,
            conaffinity=0,
        )
        if mesh:
            geom.meshname = mesh
        else:
            geom.size = _HALF_LENGTHS[shape.kind](shape.size)
        return geom

    def _add_collision(
        self, body: mujoco.MjsBody, model: Model, link: str, number: int, shape: Shape, T_body_geom: FloatArray
    ) -> None:
        name, points = f"{model.name}::{link}#{number}", None
        if shape.kind == "mesh":
            points = hull_of(shape).vertices
            self.result.spec.add_mesh(
                name=name, uservert=points.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            )
        self.add_shape(body, name, shape, T_body_geom, name if shape.kind == "mesh" else "")
        solid = Solid("hull" if shape.kind == "mesh" else shape.kind, shape.size, T_body_geom, points)
        self.result.geoms[name] = Geom(name, f"{model.name}::{link}", model.name, body.name, solid)


def _may_touch(
    models: Mapping[str, Model], robot: Model, geoms: Sequence[Geom], masks: Sequence[tuple[str, str]], itself: bool
) -> Iterator[tuple[Geom, Geom]]:
    """Yield the pairs of shapes that may touch.

    These are shapes of different models, unless both are fixed, and shapes of two links of the robot, unless these have
    a common joint or are masked; see `never_touching`.

    Args:
        models: models by name.
        robot: model of the robot.
        geoms: all collision shapes.
        masks: pairs of patterns of the robot's links that do not collide.
        itself: True if links of the robot may touch each other.
    """
    groups = {name: model.tree.rigid_groups() for name, model in models.items()}
    exempt = never_touching(robot.tree, masks) if itself else set()
    for a, b in combinations(geoms, 2):
        links = a.link.partition("::")[2], b.link.partition("::")[2]
        tops = [groups[geom.model][link][0] for geom, link in zip((a, b), links, strict=True)]
        if a.model == b.model:
            if a.model == robot.name and itself and a.link != b.link and frozenset(links) not in exempt:
                yield a, b
        elif not all(
            models[geom.model].fixed and top == models[geom.model].tree.root
            for geom, top in zip((a, b), tops, strict=True)
        ):
            yield a, b


def build(
    models: Sequence[Model],
    surfaces: Mapping[str, Surface],
    losses: Mapping[str, Losses],
    loads: Mapping[str, MassProperties],
    masks: Sequence[tuple[str, str]],
    time_step: float,
    *,
    self_collision: bool,
) -> SceneSpec:
    """Build the specification of a scene for MuJoCo's compiler.

    Args:
        models: models, the robot first.
        surfaces: surfaces by "model::link".
        losses: rotor inertia, damping and friction of moving joints by "model::joint"; joints without an entry have
            none.
        loads: payloads by "model::link", in the link's frame.
        masks: pairs of patterns of the robot's links that do not collide.
        time_step: duration of a step [s].
        self_collision: True if links of the robot may touch.

    Raises:
        DescriptionError: a joint type that the engine lacks, a moving link without mass, or an unusable mesh.
    """
    building = Building(losses, loads)
    for model in models:
        building.add(model, stops=model is models[0])
    result = building.result
    by_name, several = {model.name: model for model in models}, bool(models[0].tree.arms())
    for a, b in _may_touch(by_name, models[0], list(result.geoms.values()), masks, self_collision):
        first, second = surfaces[a.link], surfaces[b.link]
        links = [geom.link.partition("::")[2] for geom in (a, b)]
        inside = a.model == b.model and not (several and models[0].tree.apart(*links))
        law = None if inside else combine(first, second)  # within an arm contact is rigid
        pair = result.spec.add_pair(geomname1=a.name, geomname2=b.name, condim=3)
        if law is not None:
            result.springs.append((a, b, law))
            pair.margin, pair.gap = -UNSOLVED, UNSOLVED + LOOK_AHEAD * time_step
        else:
            pair.friction[:2] = first.friction * second.friction
    return result
