"""OpenSim arm model for the fit of muscles."""

import logging
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import opensim

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.curves import SampledCurves
from hric_human.muscles.fitting.model import ArmModel, Coordinate, Strengths
from hric_human.muscles.fitting.opensim_curves import CurveBench
from hric_human.muscles.fitting.sample import Paths, members

LOG = logging.getLogger("hric.human.muscles")
_TRANSLATION = 2
"""OpenSim's motion type of translational coordinates."""
_UNSAID = opensim.Model().getCredits(), opensim.Model().getPublications()
"""OpenSim's default texts for a file without credits and publications."""


_NOISE = re.compile(r"^std::exception in '.*?': |^\s*Thrown at.*$", re.MULTILINE)
"""Parts of OpenSim's messages that name its source code."""


class _Coupler:
    """Coordinate that is a function of others (OpenSim's CoordinateCouplerConstraint)."""

    def __init__(self, constraint: Any) -> None:
        names = constraint.getIndependentCoordinateNames()
        self.of = [names.get(i) for i in range(names.getSize())]
        self.name = constraint.getDependentCoordinateName()
        self._function, self._constraint = constraint.getFunction(), constraint
        self._scale = float(constraint.getPropertyByName("scale_factor").toString())

    def value(self, angles: Mapping[str, float]) -> float:
        arguments = opensim.Vector(len(self.of), 0.0)
        for i, name in enumerate(self.of):
            arguments.set(i, angles[name])
        return float(self._scale * self._function.calcValue(arguments))


class OpenSimArm(Paths, ArmModel):
    """OpenSim model of an arm. CoordinateCouplerConstraints are evaluated; other constraints are ignored.

    Attributes:
        dependent: names of the coordinates that follow others.

    Raises:
        HricError: OpenSim cannot read the model, or it has no muscles with points on bodies.
    """

    def __init__(self, path: Path) -> None:
        opensim.Logger.removeFileSink()
        opensim.Logger.setLevelString("off")
        try:
            model = opensim.Model(str(path))
            for coordinate in members(model.getCoordinateSet()):
                coordinate.set_clamped(False)
            super().__init__(model)
        except RuntimeError as error:
            reason = " ".join(_NOISE.sub("", str(error)).split())
            raise HricError(f"{path} is not an OpenSim model: {reason}") from error
        self.name, self.muscles = model.getName(), self.names
        self.credits = "; ".join(
            " ".join(text.split())
            for text in (model.getCredits(), model.getPublications())
            if text.strip() and text not in _UNSAID
        )
        pathless = [
            muscle.getName()
            for muscle in members(model.getMuscles())
            if opensim.GeometryPath.safeDownCast(muscle.getPath()) is None
        ]
        if pathless or not self.muscles:
            raise HricError(f"{path} has no muscles" + (f" with points on bodies: {pathless[0]}" if pathless else ""))
        self._joints = {_body(joint.getChildFrame()): joint for joint in members(model.getJointSet())}
        bodies = [body.getName() for body in members(model.getBodySet())]
        self.parents = _sorted({body: self._parent(body) for body in bodies})
        self._couplers = list(_couplers(model, self.state))
        self.dependent = [coupler.name for coupler in self._couplers]
        self.coordinates = [
            _coordinate(coordinate)
            for coordinate in members(model.getCoordinateSet())
            if coordinate.getName() not in self.dependent
            and coordinate.getMotionType() != _TRANSLATION
            and not coordinate.getLocked(self.state)
        ]
        down = model.getGravity().to_numpy()
        self.up = -down / np.linalg.norm(down) if np.any(down) else np.array([0.0, 1.0, 0.0])
        self._angles = {
            coordinate.getName(): coordinate.getDefaultValue() for coordinate in members(model.getCoordinateSet())
        }
        self.put({})

    def _parent(self, body: str) -> str:
        joint = self._joints.get(body)
        name = _body(joint.getParentFrame()) if joint is not None else ""
        return "" if name == self.model.getGround().getName() else name

    @property
    def angles(self) -> dict[str, float]:
        """Return the current values of all coordinates by name [rad], [m]."""
        return dict(self._angles)

    def put(self, angles: Mapping[str, float]) -> None:
        """Set coordinates by name [rad]; the others do not change, except dependent ones."""
        self._angles |= angles
        for coupler in self._couplers:
            self._angles[coupler.name] = coupler.value(self._angles)
        super().put(self._angles)

    def centre(self, body: str) -> FloatArray:
        """Return the position of the joint between a body and its parent, in the ground frame [m]."""
        return np.asarray(self._joints[body].getParentFrame().getPositionInGround(self.state).to_numpy())

    def mass_centre(self, body: str) -> FloatArray:
        """Return the centre of mass of a body in the ground frame [m]."""
        rigid_body = self.model.getBodySet().get(body)
        return np.asarray(rigid_body.findStationLocationInGround(self.state, rigid_body.getMassCenter()).to_numpy())

    def pulls(self, body: str) -> FloatArray:
        """Return each muscle's total force on a body and all distal ones, per muscle force, in ground axes [1]."""
        behind = {body}
        for other, parent in self.parents.items():
            if parent in behind:
                behind.add(other)
        return self.lines().pull(self.numbers(sorted(behind)))

    def strengths(self) -> Strengths:
        """Return the force and length parameters of the muscles, along their lines of action."""
        of = [self.model.getMuscles().get(name) for name in self.muscles]
        along = np.cos([muscle.getPennationAngleAtOptimalFiberLength() for muscle in of])
        return Strengths(
            along * [muscle.getMaxIsometricForce() for muscle in of],
            along * [muscle.getOptimalFiberLength() for muscle in of],
            np.array([muscle.getTendonSlackLength() for muscle in of]),
        )

    def curves(self) -> list[SampledCurves | str | None]:
        """Return the curves of the muscles, sampled from OpenSim's; or the reason why one cannot be sampled."""
        bench = CurveBench(self.model)
        return [bench.sampled(name) for name in self.muscles]


def _couplers(model: Any, state: Any) -> Iterator[_Coupler]:
    for constraint in members(model.getConstraintSet()):
        coupler = opensim.CoordinateCouplerConstraint.safeDownCast(constraint)
        if not constraint.isEnforced(state):
            continue
        if coupler is None:
            LOG.warning(
                "%s: constraint %s is ignored, since it is no CoordinateCouplerConstraint",
                model.getName(),
                constraint.getName(),
            )
        else:
            yield _Coupler(coupler)


def _coordinate(coordinate: Any) -> Coordinate:
    name, body = coordinate.getName(), _body(coordinate.getJoint().getChildFrame())
    return Coordinate(name, body, coordinate.getRangeMin(), coordinate.getRangeMax(), coordinate.getDefaultValue())


def _body(frame: Any) -> str:
    return str(frame.findBaseFrame().getName())


def _sorted(parents: Mapping[str, str]) -> dict[str, str]:
    """Sort the bodies so that parents come before their children."""
    made = dict[str, str]()
    while len(made) < len(parents):
        made |= {body: parent for body, parent in parents.items() if body not in made and parent in {"", *made}}
    return made
