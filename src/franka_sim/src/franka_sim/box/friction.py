"""Joint friction as the box knows it: compensated in the torques, expected in the estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite, tanh

from hric_control.errors import ParameterError, UnknownNameError

FrictionLaw = Callable[[Sequence[float]], list[float]]
"""dq (7 floats) [rad/s] -> friction torque that the motor must overcome, 7 floats [N m]."""


def friction_law(parameters: Mapping[str, Mapping[str, float]], joint_names: Sequence[str]) -> FrictionLaw:
    """The sigmoid of Gaz et al. (IEEE RA-L 2019, supplement, Table I), zero at rest.

    tau_f = phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3)) = phi1/2 (tanh(phi2 (dq + phi3) / 2) - tanh(phi2 phi3 / 2))

    Args:
        parameters: phi1 [N m], phi2 [s/rad], phi3 [rad/s] by joint name.
        joint_names: the joints in order.

    Raises:
        UnknownNameError: a joint has no parameters.
        ParameterError: a value is missing or not finite.
    """
    rows = []
    for name in joint_names:
        if name not in parameters:
            raise UnknownNameError("friction parameters for joint", name, parameters, "the control box")
        values = parameters[name]
        phi1, phi2, phi3 = (values.get(key, float("nan")) for key in ("phi1", "phi2", "phi3"))
        if not all(map(isfinite, (phi1, phi2, phi3))):
            raise ParameterError(f"control box: friction of {name} needs finite phi1, phi2 and phi3; got {dict(values)}")
        rows.append((0.5 * phi1, 0.5 * phi2, phi3, tanh(0.5 * phi2 * phi3)))

    def law(dq: Sequence[float]) -> list[float]:
        return [a * (tanh(b * (v + c)) - rest) for v, (a, b, c, rest) in zip(dq, rows, strict=True)]

    return law
