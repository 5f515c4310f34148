"""Scores of postures (RULA, REBA) and lifts (NIOSH), static and repeated muscle use, and smoothness of motions."""

from hric_assessment.ergonomics import niosh, reba, rula
from hric_assessment.ergonomics.posture import Posture, Task, of_joints

__all__ = ["Posture", "Task", "niosh", "of_joints", "reba", "rula"]
