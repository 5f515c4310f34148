"""Courses of a mass that hits a fixed surface: closed forms of each contact law, independent of the product's code."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from hric_control.plants.contact_law import ContactLaw


def expected_peak(law: ContactLaw, mass: float, speed: float) -> float:
    """Return the peak force [N] of a mass [kg] that meets the surface at a speed [m/s], without other forces."""
    return layered_peak(law, mass, speed) if law.layers else hunt_crossley_peak(law, mass, speed)


def hunt_crossley_peak(law: ContactLaw, mass: float, speed: float) -> float:
    """Return the peak by the integral of m v dv = -k x^n (1 + d v) dx, whose right side depends on x alone."""
    d, n, k = law.dissipation, law.exponent, law.stiffness

    def force(v: float) -> float:
        work = (
            0.5 * (speed**2 - v**2) if d == 0.0 else (speed - v) / d - np.log((1.0 + d * speed) / (1.0 + d * v)) / d**2
        )
        return k * ((n + 1.0) * mass / k * work) ** (n / (n + 1.0)) * (1.0 + d * v)

    highest = minimize_scalar(lambda v: -force(v), bounds=(0.0, speed), method="bounded", options={"xatol": 1e-12})
    return max(float(-highest.fun), force(0.0))


def layered_peak(law: ContactLaw, mass: float, speed: float) -> float:
    """Return the peak of the linear system of mass and layers, by its matrix exponential on a fine grid."""
    k, r, T = np.array(law.layers).T
    g = k + r
    row = np.array([1.0, 0.0, *(-r / g)]) / (1.0 / g).sum()  # force as a function of x, v and the dampers
    A = np.zeros((len(row), len(row)))
    A[0, 1], A[1] = 1.0, -row / mass
    A[2:] = np.outer(1.0 / (g * T), row) - np.diag([0.0, 0.0, *(k / (g * T))])[2:]
    state, step = np.array([0.0, speed, *(0.0 * k)]), expm(1e-5 * A)
    peak = 0.0
    while (force := row @ (state := step @ state)) > 0.0:
        peak = max(peak, float(force))
    return peak
