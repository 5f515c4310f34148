"""A log of an arm whose friction is known, from a simulation that shares nothing with the code under test but the URDF.

pinocchio's ABA, integrated by RK4; a PD controller with gravity leads the joints along sums of sines; friction by its
formula.
"""

import functools
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

MIDDLE = np.array([0.0, -0.5, 0.0, -1.9, 0.0, 1.8, 0.3])
KP = np.array([400.0, 400.0, 300.0, 300.0, 80.0, 60.0, 20.0])
KD = np.array([40.0, 40.0, 30.0, 30.0, 6.0, 5.0, 2.0])
FRICTION = np.array(
    [
        [0.62, 6.0, 0.030],
        [1.10, 8.0, 0.020],
        [0.50, 12.0, -0.040],
        [1.00, 6.5, 0.050],
        [0.70, 9.5, 0.010],
        [0.45, 14.0, -0.020],
        [0.35, 11.0, 0.000],
    ]
)
"""phi1 [N m], phi2 [s/rad], phi3 [rad/s] per joint: other values than any that come with the project."""
LOAD_COM, LOAD_INERTIA = np.array([0.02, -0.03, 0.08]), np.diag([0.004, 0.005, 0.006])
"""Of the payload: centre of mass in the flange frame [m], inertia about it [kg m^2]."""


@dataclass(frozen=True)
class Simulated:
    """time (n,) [s], q, dq, tau (n, 7) [rad, rad/s, N m]: tau acts behind the gear, friction included."""

    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    tau: np.ndarray


def sigmoid(dq: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Friction torque; phi: shape (..., 3)."""
    phi1, phi2, phi3 = phi[..., 0], phi[..., 1], phi[..., 2]
    return phi1 / (1.0 + np.exp(-phi2 * (dq + phi3))) - phi1 / (1.0 + np.exp(-phi2 * phi3))


def desired(t: float, still: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity: three sines per joint below 0.6 Hz; joints in `still` do not move."""
    joints = np.arange(7)
    q, dq = MIDDLE.copy(), np.zeros(7)
    for k, (amplitude, base) in enumerate(((0.35, 0.11), (0.15, 0.29), (0.06, 0.53))):
        w = 2.0 * np.pi * (base + 0.011 * joints)
        phase = 1.3 * joints + 0.7 * k
        q += amplitude * (np.sin(w * t + phase) - np.sin(phase))
        dq += amplitude * w * np.cos(w * t + phase)
    held = list(still)
    q[held], dq[held] = MIDDLE[held], 0.0
    return q, dq


@functools.cache
def simulate(
    urdf: str, duration: float = 12.0, still: tuple[int, ...] = (), load: float = 0.0, period: float = 1e-3
) -> Simulated:
    """A log with a sample per millisecond; load: mass of a ball at `LOAD_COM` of the flange [kg]."""
    model = pin.buildModelFromXML(urdf)
    flange = model.frames[model.getFrameId("panda_link8")]
    if load:
        model.inertias[7] += flange.placement.act(pin.Inertia(load, LOAD_COM, LOAD_INERTIA))
    data = model.createData()
    n = round(duration / period)
    q, dq = MIDDLE.copy(), desired(0.0, still)[1]
    rows = np.empty((3, n, 7))

    def slope(q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return dq, pin.aba(model, data, q, dq, tau - sigmoid(dq, FRICTION))

    for k in range(n):
        q_d, dq_d = desired(k * period, still)
        tau = KP * (q_d - q) + KD * (dq_d - dq) + pin.computeGeneralizedGravity(model, data, q)
        rows[:, k] = q, dq, tau
        a = slope(q, dq, tau)
        b = slope(q + 0.5 * period * a[0], dq + 0.5 * period * a[1], tau)
        c = slope(q + 0.5 * period * b[0], dq + 0.5 * period * b[1], tau)
        d = slope(q + period * c[0], dq + period * c[1], tau)
        q = q + period / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        dq = dq + period / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
    return Simulated(np.arange(n) * period, *rows)
