"""Transition velocity of Coulomb friction, as a smooth function of the speed that can be integrated."""

import math

from hric_core.urdf import ONE_COORDINATE, Joint, Robot
from urdf_to_osim.min_inertias import min_inertias
from urdf_to_osim.options import Options

REST_TIME = 0.002
"""Time constant with which friction alone stops a slow, free joint [s] (project default, unconfirmed)."""
DAMPING_SHARE = 0.5
"""Friction damping allowed at any inertia, relative to viscous damping [1] (project default, unconfirmed)."""
SPEED_SHARE = 0.01
"""Smallest transition velocity relative to the joint's velocity limit [1] (project default, unconfirmed)."""
USUAL_SPEED, HIGHEST_SPEED = 1.0, 10.0
"""Speed without a velocity limit, and upper bound of limits [rad/s or m/s] (project defaults, unconfirmed).

Descriptions contain limits such as 1e4.
"""


def transition_velocities(robot: Robot, options: Options) -> dict[str, float]:
    """Return v of Coulomb friction -f tanh(dq/v) by joint, the user's or `transition_velocity` [rad/s or m/s]."""
    rubbing = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE and joint.friction > 0.0]
    if options.friction != "coulomb" or not rubbing:
        return {}
    if options.friction_velocity is not None:
        return {joint.name: options.friction_velocity for joint in rubbing}
    inertias = min_inertias(robot)
    return {joint.name: transition_velocity(joint, inertias.get(joint.name, math.inf)) for joint in rubbing}


def transition_velocity(joint: Joint, inertia: float) -> float:
    """Return v = max(0.01 dq_max, min(0.002 s * f / I, f / (0.5 b))) [rad/s or m/s], with this module's constants.

    At rest friction is a damping of f/v. With v = T f/I it slows the joint with the time constant T, for which an
    integrator needs steps of about T; if the description's damping b requires shorter steps, friction may be as steep
    as a part of it.

    Args:
        joint: f its friction [N m or N], b its damping [N m s/rad or N s/m], dq_max its velocity limit [rad/s or m/s].
        inertia: inertia I of the joint [kg m^2 or kg].
    """
    speed = USUAL_SPEED if math.isinf(joint.velocity) else min(joint.velocity, HIGHEST_SPEED)
    damped = joint.friction / (DAMPING_SHARE * joint.damping) if joint.damping > 0.0 else math.inf
    return max(SPEED_SHARE * speed, min(REST_TIME * joint.friction / inertia, damped))


def note(velocities: dict[str, float]) -> str:
    """Return a note with the velocities."""
    return (
        f"friction is -f tanh(dq/v), v [rad/s or m/s]: {', '.join(f'{name} {v:.3g}' for name, v in velocities.items())}"
    )
