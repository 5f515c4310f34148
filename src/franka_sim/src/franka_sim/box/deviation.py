"""How far the arm may be from its desired pose, as the client that began the motion asked for it."""

from __future__ import annotations

from math import acos, dist

from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest
from franka_sim.box.state import BoxState

PATH: Errors = frozenset(("max_path_pose_deviation_violation",))
GOAL: Errors = frozenset(("max_goal_pose_deviation_violation",))
_USUAL = MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE)


def deviation(state: BoxState) -> tuple[float, float, float]:
    """Distance of the measured from the desired end effector: translation [m], rotation [rad], elbow (joint 3) [rad]."""
    a, b = state.O_T_EE, state.O_T_EE_d
    # Trace of R_a' R_b: the sum of the products of equal elements.
    trace = sum(a[i] * b[i] for i in (0, 1, 2, 4, 5, 6, 8, 9, 10))
    return dist(a[12:15], b[12:15]), acos(min(max(0.5 * (trace - 1.0), -1.0), 1.0)), abs(state.elbow[0] - state.elbow_d[0])


class DeviationLimits:
    """Limits of path and goal; libfranka's defaults are wider than any pose can be wrong, and cost nothing.

    Attributes:
        path, goal: translation [m], rotation [rad], elbow [rad]; None: no limit.
    """

    def __init__(self, request: MoveRequest) -> None:
        path, goal = request.max_path_deviation, request.max_goal_deviation
        self.path = path if any(a < b for a, b in zip(path, _USUAL.max_path_deviation, strict=True)) else None
        self.goal = goal if any(a < b for a, b in zip(goal, _USUAL.max_goal_deviation, strict=True)) else None

    def errors(self, state: BoxState, finished: bool) -> Errors:
        """What is violated; finished: the motion ends here, so that the limits of the goal hold too."""
        limits = [(self.path, PATH)] + ([(self.goal, GOAL)] if finished else [])
        for limit, names in limits:
            if limit is not None and any(x > most for x, most in zip(deviation(state), limit, strict=True)):
                return names
        return NO_ERRORS
