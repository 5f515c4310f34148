"""Motion of a real person from markers: `measured` of a recorded trial, `tracking` live, `live_load` of the muscles.

from hric_motion.measured import measured

motion = measured(subject, names, positions, rate)  # shape (frames, markers, 3) [m], NaN: not visible
motion.q, motion.spread                             # joint angles, NaN: not known; standard deviations [rad]
"""
