"""What run.yaml says of a live run when its recording begins."""

from __future__ import annotations

from collections.abc import Sequence

import rospy

from hric_control.ros_node import RosNode
from hric_experiments import experiment as experiments
from hric_experiments import files, limits, provenance
from hric_experiments.recorder_settings import RecorderSettings
from hric_experiments.run_folder import RUNNING, RunFolder, iso_now


def write(folder: RunFolder, definition: experiments.Experiment, name: str, overrides: Sequence[str], settings: RecorderSettings) -> None:
    """Write run.yaml and the robot's description.

    Args:
        folder: the run's.
        definition, name: what is run, and what it is called.
        overrides: of the experiment.
        settings: what a person said of the run.
    """
    description = _description()
    folder.write(
        {
            "experiment": name,
            "description": definition.description,
            **({"subject": settings.subject} if settings.subject else {}),
            **({"notes": provenance.neutral(settings.notes)} if settings.notes else {}),
            "status": RUNNING,
            "mode": "live",
            "started": iso_now(),
            "finished": None,
            "arguments": provenance.neutral(list(overrides)),
            "bag": folder.bag_path.name,
            "definition": provenance.neutral(experiments.to_dict(definition)),
            "parameters": provenance.parameters(rospy.get_param(rospy.get_namespace().rstrip("/") or "/", {}) or {}),
            "limits": _limits(description),
            "versions": provenance.versions(),
            "revision": provenance.revision(),
            "platform": provenance.platform_info(),
        }
    )
    if description:
        files.write_text(folder.urdf_path, description)


def _limits(description: str) -> dict[str, dict[str, float]]:
    return limits.table(description, RosNode(rospy.get_namespace())) if description else {}


def _description() -> str:
    """URDF on the parameter server, nearest to this node; empty: there is none."""
    return str(rospy.get_param(rospy.search_param("robot_description") or "robot_description", ""))
