"""Muscles of a human's arms.

muscles = MuscleSet(body, find("delft", "anatomy"))        # or from your own model: find("arm.osim", "anatomy")
state = muscles.at(q, dq)                                  # each cycle
tau = state.torque(activation)                             # of the joints muscles.joints [N m]
"""

from hric_human.muscles.anatomy import BUILT_IN, Anatomy, FitError, Muscle, load
from hric_human.muscles.choose import find
from hric_human.muscles.muscle_set import MuscleSet, MuscleState
from hric_human.muscles.polynomial import Polynomial

__all__ = ["BUILT_IN", "Anatomy", "FitError", "Muscle", "MuscleSet", "MuscleState", "Polynomial", "find", "load"]
