"""From a run folder to how well a marker was followed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_experiments import kinematics, tracking, tracking_record
from hric_experiments.bag_reader import BagError, RunRecord
from hric_experiments.run_folder import RunFolder
from hric_experiments.tracking import Followed
from hric_experiments.tracking_record import TrackingRecord

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Tracking:
    """What a run tells about following a marker.

    Attributes:
        record: what the bag tells.
        data: marker and end effector on a common time; None: no valid marker came.
        values: what stands under `tracking` in metrics.json.
    """

    record: TrackingRecord
    data: Followed | None
    values: dict[str, Any]


def analyse(folder: RunFolder, bag: Path, run: Mapping[str, Any], record: RunRecord) -> Tracking | None:
    """How well the marker was followed; None where no controller followed one.

    Args:
        folder: of the run, for the robot's description.
        bag: its bag.
        run: contents of its run.yaml.
        record: what else the bag tells.

    Raises:
        HricError: the description is missing or does not suit.
    """
    body = str((((run.get("definition") or {}).get("mocap")) or {}).get("body") or "")
    found = tracking_record.read(bag, record.run_time, body)
    if found is None:
        return None
    own = (run.get("parameters") or {}).get(found.states.controller) or {}
    R = np.eye(3) if found.frames.frame == found.base else np.array(own.get("frame_rotation", tracking.THESIS_ROTATION), dtype=float)
    try:
        description = folder.urdf_path.read_text()
    except OSError as error:
        raise BagError(f"cannot read {folder.urdf_path.name} of {folder.path.name}: {error.strerror}") from error
    arm_id = str(own.get("arm_id") or "panda")
    ee = kinematics.positions(description, record.log, f"{arm_id}_link0", f"{arm_id}_link8", found.p_flange_ee)
    data = tracking.followed(found, record.log.time, ee, R, catch_up=own.get("on_return") == "catch_up")
    return Tracking(found, data, tracking.metrics(data, found, record.log.time, ee, R))
