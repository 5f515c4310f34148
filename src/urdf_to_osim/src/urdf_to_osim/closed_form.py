"""What damping, friction and stops must be, in closed form and in SI units: the proof compares the model's forces with these."""

from __future__ import annotations

import math

from hric_control.plants.friction import sigmoid_parameters
from urdf_to_osim.forces import stop_parameters
from urdf_to_osim.options import Options
from urdf_to_osim.urdf import Joint


def damping(joint: Joint, dq: float) -> float:
    """-b dq [N m or N]; dq in [rad/s or m/s]."""
    return -joint.damping * dq


def friction(joint: Joint, dq: float, options: Options, velocity: float) -> float:
    """Coulomb: -f tanh(dq/v) with v = `velocity`; sigmoid: -(phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3))) [N m or N]."""
    if options.friction == "coulomb":
        return -joint.friction * math.tanh(dq / velocity)
    if joint.name not in options.friction_parameters:
        return 0.0
    phi1, phi2, phi3 = sigmoid_parameters(options.friction_parameters, [joint.name])[0]
    return -(phi1 / (1.0 + math.exp(-phi2 * (dq + phi3))) - phi1 / (1.0 + math.exp(-phi2 * phi3)))


def stop(joint: Joint, q: float, dq: float, options: Options) -> float:
    """Effort of a joint's stop [N m or N] at q [rad or m], dq [rad/s or m/s].

    Beyond a limit by d the share s of stiffness k and damping c acts, -s (k d + c dq), where s = 10 y^3 - 15 y^4 + 6 y^5 with y = d / transition
    grows from 0 to 1 (CoordinateLimitForce, OpenSim API reference).
    """
    if math.isinf(joint.lower):
        return 0.0
    stiffness, loss, transition = stop_parameters(joint, options)
    above, below = _share((q - joint.upper) / transition), _share((joint.lower - q) / transition)
    return above * stiffness * (joint.upper - q) + below * stiffness * (joint.lower - q) - (above + below) * loss * dq


def _share(y: float) -> float:
    y = min(max(y, 0.0), 1.0)
    return y**3 * (10.0 - 15.0 * y + 6.0 * y**2)
