"""The muscles of a human's arms.

muscles = MuscleSet(body, load(BUILT_IN))
state = muscles.at(q, dq)                                  # each cycle
tau = state.torque(activation)                             # of the joints muscles.joints [N m]
"""

from hric_human.muscles.anatomy import BUILT_IN, Anatomy, FitError, Muscle, load
from hric_human.muscles.muscle_set import MuscleSet, MuscleState
from hric_human.muscles.polynomial import Polynomial

__all__ = ["BUILT_IN", "Anatomy", "FitError", "Muscle", "MuscleSet", "MuscleState", "Polynomial", "load"]
