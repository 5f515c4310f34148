"""Transition velocity v of Coulomb friction -f tanh(dq/v), a smooth form of friction that OpenSim can integrate."""

import math

from hric_core.urdf import ONE_COORDINATE, Joint, Robot
from urdf_to_osim.min_inertias import min_inertias
from urdf_to_osim.options import Options

REST_TIME = 0.002
"""Time constant with which friction alone stops a slow, free joint [s] (project default, unconfirmed)."""
DAMPING_SHARE = 0.5
"""Slope of the friction at rest that is always allowed, as a fraction of the viscous damping [1].

Project default, unconfirmed.
"""
SPEED_SHARE = 0.01
"""Minimum transition velocity as a fraction of the joint's velocity limit [1] (project default, unconfirmed)."""
USUAL_SPEED, HIGHEST_SPEED = 1.0, 10.0
"""Velocity limit that is assumed if there is none, and upper bound of all velocity limits [rad/s or m/s].

The bound is needed because some descriptions contain limits such as 1e4. Project defaults, unconfirmed.
"""


def transition_velocities(robot: Robot, options: Options) -> dict[str, float]:
    """Return the transition velocity v of Coulomb friction -f tanh(dq/v) [rad/s or m/s], by joint with friction.

    It is the option `friction_velocity`, or if that is None, chosen for each joint. Empty without Coulomb friction.
    """
    rubbing = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE and joint.friction > 0.0]
    if options.friction != "coulomb" or not rubbing:
        return {}
    if options.friction_velocity is not None:
        return {joint.name: options.friction_velocity for joint in rubbing}
    inertias = min_inertias(robot)
    return {joint.name: transition_velocity(joint, inertias.get(joint.name, math.inf)) for joint in rubbing}


def transition_velocity(joint: Joint, inertia: float) -> float:
    """Return the transition velocity v of a joint's Coulomb friction -f tanh(dq/v) [rad/s or m/s].

    v = max(0.01 dq_max, min(0.002 s * f / I, f / (0.5 b))), with the numbers of this module's constants.

    Near rest, friction acts as a damping of f/v. With v = T f/I it slows the joint with the time constant T, for which
    an integrator needs steps of about T. If the joint's damping b requires shorter steps anyway, friction may be as
    steep as a fraction of b.

    Args:
        joint: joint with friction f [N m or N], damping b [N m s/rad or N s/m], velocity limit dq_max [rad/s or m/s].
        inertia: inertia I of the joint [kg m^2 or kg].
    """
    speed = USUAL_SPEED if math.isinf(joint.velocity) else min(joint.velocity, HIGHEST_SPEED)
    damped = joint.friction / (DAMPING_SHARE * joint.damping) if joint.damping > 0.0 else math.inf
    return max(SPEED_SHARE * speed, min(REST_TIME * joint.friction / inertia, damped))


def note(velocities: dict[str, float]) -> str:
    """Return a note for the user with the transition velocities by joint."""
    return (
        f"friction is -f tanh(dq/v), v [rad/s or m/s]: {', '.join(f'{name} {v:.3g}' for name, v in velocities.items())}"
    )
