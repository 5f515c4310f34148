"""Conversion between ROS messages and the data of person tracking (`hric_motion.tracking`). No node."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from hric_core.geometry import IDENTITY, FloatArray, Pose, stamped
from hric_human.body import Body
from hric_human.body.segments import ROOT
from hric_human.control.whole_body import WholeBody
from hric_motion.tracking import LOST, PersonEstimate
from hric_msgs.msg import PersonTracking

PERSON = "person"
"""Name of a real, tracked person in topics `hric/person/...` and frames; a simulated human is called `human`."""
_NOWHERE = Pose((math.nan, math.nan, math.nan), IDENTITY)


class PersonMarkers:
    """Reader of a person's marker positions from motion capture frames.

    Args:
        names: names of the markers, in the order of the rows.
        labels: name in the mocap stream by marker, for markers that have another name there.
        asset: Motive asset to which the markers belong; "": any.
    """

    def __init__(self, names: Sequence[str], labels: Mapping[str, str], asset: str) -> None:
        self._rows = {labels.get(name, name): row for row, name in enumerate(names)}
        self._count, self._asset = len(names), asset

    def positions(self, message: Any) -> FloatArray:
        """Return the positions of the markers from a hric_msgs/MocapData, shape (m, 3) [m]; NaN: not visible.

        A marker name that occurs in several assets is NaN, because the assets may be several people.
        """
        rows, assets = np.full((self._count, 3), np.nan), dict[int, str]()
        for label, point in zip(message.labelled_marker_names, message.labelled_markers, strict=True):
            asset, _, name = label.rpartition("/")
            row = self._rows.get(name)
            if row is not None and (not self._asset or asset == self._asset):
                alone = assets.setdefault(row, asset) == asset
                rows[row] = (point.x, point.y, point.z) if alone else math.nan
        return rows


class BodyMessages:
    """Converter of tracking estimates of one body to ROS messages.

    Args:
        body: body whose joints are estimated.
        calibrated: True if the body was fitted to the person.
    """

    def __init__(self, body: Body, calibrated: bool) -> None:
        self._joints, self._calibrated, self._dynamics = list(body.joints), calibrated, WholeBody(body)
        self._needed = self._joints_of_links(body)

    @staticmethod
    def _joints_of_links(body: Body) -> dict[str, list[int]]:
        """Return, for each link, the indices of the joints between the body's root and that link."""
        by_link: dict[str, list[int]] = {ROOT: []}
        for segment in body.segments.values():
            rows = [row for row, joint in enumerate(body.joints.values()) if joint.link == segment.link]
            by_link[segment.link] = by_link[segment.parent] + rows
        return by_link

    def joint_states(self, head: Any, estimate: PersonEstimate) -> Any:
        """Return sensor_msgs/JointState of an estimate, without joints whose position is lost."""
        known = [row for row, state in enumerate(estimate.states) if state != LOST]
        message = JointState(header=head, name=[self._joints[row] for row in known])
        message.position, message.velocity = [estimate.q[row] for row in known], [estimate.dq[row] for row in known]
        return message

    def tracking(self, head: Any, estimate: PersonEstimate, dropped: int) -> Any:
        """Return hric_msgs/PersonTracking of an estimate; dropped: number of mocap frames skipped so far."""
        root = _NOWHERE if estimate.root_state == LOST else estimate.root
        return PersonTracking(
            header=head,
            calibrated=self._calibrated,
            root=stamped.pose_message(root),
            root_state=estimate.root_state,
            name=self._joints,
            state=estimate.states,
            residual=estimate.residual,
            missing=estimate.missing,
            dropped=dropped,
        )

    def frames(self, head: Any, estimate: PersonEstimate) -> Any:
        """Return tf2_msgs/TFMessage: `person/LINK` of links that are not lost; head: std_msgs/Header of the markers."""
        if estimate.root_state == LOST:
            return TFMessage()
        poses = self._dynamics.poses(estimate.q, estimate.root)
        return TFMessage([
            stamped.transform_stamped(head, f"{PERSON}/{link}", poses[link])
            for link, rows in self._needed.items()
            if all(estimate.states[row] != LOST for row in rows)
        ])  # fmt: skip
