"""Tracking of a real person: joint angles of the body from the markers that motion capture measures. No ROS.

    tracker = PersonTracker(body, list(body.markers))
    estimate = tracker.update(time, positions)         # each frame, NaN if a marker is not visible
    estimate.q, estimate.states, estimate.residual

`calibration` fits body and markers to the person in a still pose.
"""

from hric_motion.tracking.calibration import BodyCalibration, StillPose, calibrate
from hric_motion.tracking.tracker import BRIDGED, LOST, MEASURED, PersonEstimate, PersonTracker

__all__ = [
    "BRIDGED",
    "LOST",
    "MEASURED",
    "BodyCalibration",
    "PersonEstimate",
    "PersonTracker",
    "StillPose",
    "calibrate",
]
