"""Scores of postures (RULA, REBA), of lifts (NIOSH), and of how smooth a movement is."""

from hric_assessment.ergonomics import niosh, reba, rula
from hric_assessment.ergonomics.posture import Posture, Task, of_joints

__all__ = ["Posture", "Task", "niosh", "of_joints", "reba", "rula"]
