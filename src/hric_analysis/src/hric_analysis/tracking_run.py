"""Analysis of marker tracking in a run, with the forward kinematics of its control log. No ROS."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy

from hric_analysis import tracking, tracking_record
from hric_analysis.tracking import FollowedMarker
from hric_analysis.tracking import TrackingMetrics as TrackingMetrics
from hric_analysis.tracking_record import TrackingRecord
from hric_bags.parts import Bag
from hric_bags.reader import BagError, ControlRecord, RunRecord
from hric_bags.run_file import RunFile
from hric_core.urdf import read

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MarkerTracking:
    """Marker tracking of a run: recorded data and metrics.

    Attributes:
        record: recorded frames, controller states and true motion.
        data: marker and end effector on a common time axis; None: there was no valid marker.
        values: metrics of the tracking.
    """

    record: TrackingRecord
    data: FollowedMarker | None
    values: TrackingMetrics


def analyse(description: str, bag: Path | Bag, run: RunFile, record: RunRecord) -> MarkerTracking | None:
    """Analyse the marker tracking of a run; None: no controller followed a marker.

    Args:
        description: URDF of the robot; "": the run folder has none.
        bag: bag of the run, or a reader of it.
        run: contents of run.yaml.
        record: control log with setpoints, profiles and reflexes.

    Raises:
        HricError: the robot description is missing, or has no chain from base to flange.
    """
    definition = run.get("definition") or {}
    body = str((definition.get("mocap") or {}).get("body") or "")
    tracked = tracking_record.read(bag, record.robot_time, body)
    if tracked is None:
        return None
    parameters, arm = run.get("parameters") or {}, tracked.base.removesuffix("_link0")
    parameters = parameters.get(arm) or {} if arm in (definition.get("arms") or {}) else parameters
    parameters = parameters.get(tracked.states.controller) or {}
    R = (
        np.eye(3)
        if tracked.frames.frame == tracked.base
        else np.array(parameters.get("frame_rotation", tracking.THESIS_ROTATION), dtype=float)
    )
    if not description:
        raise BagError("the robot followed a marker, but the run folder has no robot description (robot.urdf)")
    tip = str(parameters.get("end_effector") or f"{parameters.get('arm_id') or 'panda'}_link8")
    ee = tip_positions(description, record.log, tracked.base, tip, tracked.p_flange_ee)
    data = tracking.followed(tracked, record.log.time, ee, R, catch_up=parameters.get("on_return") == "catch_up")
    return MarkerTracking(tracked, data, tracking.metrics(data, tracked, record.log.time, ee, R))


def tip_positions(description: str, log: ControlRecord, base: str, tip: str, p_tip: FloatArray) -> FloatArray:
    """Return the positions of a point on the tip link in all cycles, in the base frame, shape (n, 3) [m].

    Args:
        description: URDF of the robot.
        log: control log with the joint positions; joints that are not in the log are at 0.
        base: name of the base link.
        tip: name of the tip link.
        p_tip: position of the point in the tip frame, shape (3,) [m].

    Raises:
        HricError: a link does not exist, or there is no chain from base to tip.
    """
    R = np.broadcast_to(np.eye(3), (log.cycles, 3, 3))
    p = np.zeros((log.cycles, 3))
    for joint in read(description).path(base, tip):
        T = joint.T_parent_joint
        p, R = p + R @ T[:3, 3], R @ T[:3, :3]
        if joint.name in log.joint_names:
            q = log.position[:, [log.joint_names.index(joint.name)]]
            if joint.type == "prismatic":
                p = p + np.einsum("nij,nj->ni", R, q * joint.axis)
            else:
                R = R @ scipy.spatial.transform.Rotation.from_rotvec(q * joint.axis).as_matrix()
    return p + R @ p_tip
