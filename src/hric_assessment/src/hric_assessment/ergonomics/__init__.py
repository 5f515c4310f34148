"""Ergonomics of a motion: posture scores (RULA, REBA), lifts (NIOSH), static and repeated muscle use, smoothness."""

from hric_assessment.ergonomics.posture import Posture, Task, of_joints

__all__ = ["Posture", "Task", "of_joints"]
