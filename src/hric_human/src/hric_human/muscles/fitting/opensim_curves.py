"""Curves of OpenSim muscles of any class, sampled along their lines of action with a rigid tendon."""

import math
from typing import Any

import numpy as np
import opensim

from hric_core.geometry import FloatArray
from hric_human.muscles.curves import LENGTHS, SPEEDS, SampledCurves

DEPRECATED = "_Deprecated"
"""End of the class names of OpenSim's muscles from before version 3, for example Schutte1993Muscle_Deprecated.

Their active force with a rigid tendon includes the passive force, and the speed of their fibres is that along the line
of action.
"""
ELASTIC_ONLY = "Thelen2003Muscle"
"""Class whose tendon cannot be made rigid; its fibre length is set instead."""


class CurveBench:
    """OpenSim model with copies of a model's muscles along one slider, whose position is the length of all of them."""

    def __init__(self, model: Any) -> None:
        self._model = opensim.Model()
        body = opensim.Body("body", 1.0, opensim.Vec3(0.0), opensim.Inertia(1.0))
        joint = opensim.SliderJoint("slider", self._model.getGround(), body)
        joint.updCoordinate().setName("length")
        self._model.addBody(body)
        self._model.addJoint(joint)
        for k in range(model.getMuscles().getSize()):
            clone = model.getMuscles().get(k).clone()
            clone.thisown = 0  # the bench's model owns the copy
            muscle = opensim.Muscle.safeDownCast(clone)
            path = opensim.FunctionBasedPath()
            path.setLengthFunction(opensim.LinearFunction(1.0, 0.0))
            path.appendCoordinatePath("/jointset/slider/length")
            muscle.set_path(path)
            kind = muscle.getConcreteClassName()
            muscle.set_ignore_tendon_compliance(kind != ELASTIC_ONLY and not kind.endswith(DEPRECATED))
            self._model.addForce(muscle)
        self._state = self._model.initSystem()
        self._slider = self._model.getCoordinateSet().get(0)

    def sampled(self, name: str) -> SampledCurves | str:
        """Return the curves of a muscle, or the reason why they cannot be sampled."""
        muscle = self._model.getMuscles().get(name)
        kind, alpha = muscle.getConcreteClassName(), muscle.getPennationAngleAtOptimalFiberLength()
        old, along = kind.endswith(DEPRECATED), math.cos(alpha)
        fastest = muscle.getMaxContractionVelocity() / (1.0 if old else along**2)
        if not 0.0 < fastest < math.inf:
            return f"its max_contraction_velocity is {muscle.getMaxContractionVelocity():g}; valid: above 0"
        unit = along * muscle.getOptimalFiberLength()
        try:
            rigid = np.array([self._active(muscle, unit, length, 0.0) for length in LENGTHS])
            passive = np.array([self._passive(muscle, unit, alpha, length, old) for length in LENGTHS])
            at_speed = np.array([self._active(muscle, unit, 1.0, fastest * speed) for speed in SPEEDS])
            return SampledCurves(
                fastest,
                _rounded(rigid - passive if old else rigid),
                _rounded(passive),
                _rounded(np.ones(len(LENGTHS)) if old else LENGTHS / np.hypot(LENGTHS * along, math.sin(alpha))),
                _rounded(at_speed / self._active(muscle, unit, 1.0, 0.0)),
            )
        except (RuntimeError, ValueError, ArithmeticError) as error:
            return f"OpenSim cannot evaluate its curves ({kind}): {str(error).strip().splitlines()[0]}"

    def _put(self, muscle: Any, unit: float, length: float, velocity: float) -> None:
        """Set fibre length and its rate, both along the line of action and per optimal length `unit` [m]."""
        self._slider.setValue(self._state, muscle.getTendonSlackLength() + unit * float(length), False)
        self._slider.setSpeedValue(self._state, unit * float(velocity))
        self._model.realizeVelocity(self._state)

    def _active(self, muscle: Any, unit: float, length: float, velocity: float, activation: float = 1.0) -> float:
        """Return OpenSim's active force with a rigid tendon, per maximum isometric force along the line of action."""
        self._put(muscle, unit, length, velocity)
        force = float(muscle.calcInextensibleTendonActiveFiberForce(self._state, activation))
        return float(force * muscle.getOptimalFiberLength() / (unit * muscle.getMaxIsometricForce()))

    def _passive(self, muscle: Any, unit: float, alpha: float, length: float, old: bool) -> float:
        """Return the passive force, per maximum isometric force along the line of action."""
        if old:
            return self._active(muscle, unit, length, 0.0, activation=0.0)
        self._put(muscle, unit, length, 0.0)
        optimal = muscle.getOptimalFiberLength()
        if not muscle.get_ignore_tendon_compliance():
            fibres = opensim.ActivationFiberLengthMuscle.safeDownCast(muscle)
            fibres.setFiberLength(self._state, math.hypot(unit * float(length), optimal * math.sin(alpha)))
            self._model.realizeVelocity(self._state)
        force = float(muscle.getPassiveFiberForceAlongTendon(self._state))
        return float(force * optimal / (unit * muscle.getMaxIsometricForce()))


def _rounded(values: FloatArray) -> tuple[float, ...]:
    """Round to six decimals: the curves have values of about 1."""
    return tuple(np.round(values, 6).tolist())
