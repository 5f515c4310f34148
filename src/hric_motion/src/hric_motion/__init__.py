"""Motion of a recorded person from the markers of a trial.

motion = measured(subject, names, positions, rate)  # shape (frames, markers, 3) [m], NaN: not visible
motion.q, motion.spread                             # joint angles, NaN: not known; standard deviations [rad]
"""

from hric_motion.measured import MeasuredMotion, measured

__all__ = ["MeasuredMotion", "measured"]
