"""Scores of postures (RULA, REBA) and of lifts (NIOSH), static and repeated use, smoothness of a movement."""

from hric_assessment.ergonomics import niosh, reba, rula
from hric_assessment.ergonomics.posture import Posture, Task, of_joints

__all__ = ["Posture", "Task", "niosh", "of_joints", "reba", "rula"]
