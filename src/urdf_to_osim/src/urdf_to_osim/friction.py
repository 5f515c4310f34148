"""How fast a joint must move for Coulomb friction to act fully: friction as a smooth function of the speed, soft enough
to be integrated."""

import math

from hric_control.urdf import ONE_COORDINATE, Joint, Robot
from urdf_to_osim.min_inertias import min_inertias
from urdf_to_osim.options import Options

REST_TIME = 0.002
"""Time constant with which friction alone brings a slow, free joint to rest [s]: default chosen by this project,
unconfirmed."""
DAMPING_SHARE = 0.5
"""Friction may damp a slow joint by this part of the description's own viscous damping, however light it is.
Default chosen by this project, unconfirmed."""
SPEED_SHARE = 0.01
"""Least transition as a part of the joint's velocity limit: default chosen by this project, unconfirmed."""
USUAL_SPEED, HIGHEST_SPEED = 1.0, 10.0
"""Speed where the description has no velocity limit, and what a limit counts at most [rad/s or m/s]: descriptions write
1e4 and the like. Defaults chosen by this project, unconfirmed."""


def transition_velocities(robot: Robot, options: Options) -> dict[str, float]:
    """v of Coulomb friction, -f tanh(dq/v), for each joint that has it [rad/s or m/s]: the user's, or by
    `transition_velocity`."""
    rubbing = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE and joint.friction > 0.0]
    if options.friction != "coulomb" or not rubbing:
        return {}
    if options.friction_velocity is not None:
        return {joint.name: options.friction_velocity for joint in rubbing}
    inertias = min_inertias(robot)
    return {joint.name: transition_velocity(joint, inertias.get(joint.name, math.inf)) for joint in rubbing}


def transition_velocity(joint: Joint, inertia: float) -> float:
    """v = max(0.01 dq_max, min(0.002 s * f / I, f / (0.5 b))) [rad/s or m/s], with the numbers of this module.

    At rest friction is a damping of f/v. With v = T f/I it slows the joint with the time constant T, for which an
    integrator needs steps of about T; where the description's damping b needs shorter steps, friction may be as
    steep as a part of it.

    Args:
        joint: f its friction [N m or N], b its damping [N m s/rad or N s/m], dq_max its velocity limit [rad/s or m/s].
        inertia: I, what resists the joint [kg m^2 or kg].
    """
    speed = USUAL_SPEED if math.isinf(joint.velocity) else min(joint.velocity, HIGHEST_SPEED)
    damped = joint.friction / (DAMPING_SHARE * joint.damping) if joint.damping > 0.0 else math.inf
    return max(SPEED_SHARE * speed, min(REST_TIME * joint.friction / inertia, damped))


def note(velocities: dict[str, float]) -> str:
    """The velocities as a note."""
    return (
        f"friction is -f tanh(dq/v), v [rad/s or m/s]: {', '.join(f'{name} {v:.3g}' for name, v in velocities.items())}"
    )
