"""Muscle and joint load of a person's arms in a recorded motion.

The motion comes from the joint states and grips of a run or from the markers of a c3d file; the load is computed by
`hric_human.muscles.after_run`. The output is a text table and .sto files for OpenSim.
"""

from hric_report.muscle_load.c3d import of_c3d, plate_load
from hric_report.muscle_load.command import render, write
from hric_report.muscle_load.motions import MuscleLoadResult, of_run, of_tracked
from hric_report.muscle_load.person import DescribedPerson, MuscleLoadError, described_by

__all__ = [
    "DescribedPerson",
    "MuscleLoadError",
    "MuscleLoadResult",
    "described_by",
    "of_c3d",
    "of_run",
    "of_tracked",
    "plate_load",
    "render",
    "write",
]
