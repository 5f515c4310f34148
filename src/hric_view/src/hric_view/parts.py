"""Parts of the window: motion capture, end effector, force plates, muscles, skin; they need no ROS master.

Each part stores the newest message of its topic, and no longer draws it when it is older than LOST.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hric_assessment.contact.limits import TRANSIENT_TIME, Limits
from hric_core.geometry import quaternion_from_rotation
from hric_human.body.segments import SIDES
from hric_human.muscles.lines import ACTIVATION_COLOURS
from hric_report.html.body_picture import region_keys
from hric_report.html.moving import BODY, PLATE_SIZE, Statics, placement
from hric_report.html.scene import SceneLines
from hric_view.live import DIGITS

LOST = 0.25
"""Age above which a message is no longer drawn [s of wall time]; longer if a simulation is slower than real time;
project default."""
FORCE_DIGITS = 2
"""Number of decimals of forces [N], activations [1] and shares of limits [1] in frames."""
PLATE_FRAME = "force_plate_"
"""Prefix of the tf frames of force plates; the plate's id follows it."""


class LiveState:
    """Newest message of a topic, as long as it is not too old; thread-safe.

    Attributes:
        patience: age above which a message is too old [s of wall time]; LivePace makes it longer than LOST while a
            simulation is slower than real time.
    """

    patience = LOST

    def __init__(self) -> None:
        self._newest: tuple[float, Any] = (-math.inf, None)

    def push(self, message: Any) -> None:
        """Store a message."""
        self._newest = (time.monotonic(), message)

    def get(self) -> Any:
        """Return the newest message; None: there is none, or it is older than `patience`."""
        received, message = self._newest
        return message if time.monotonic() - received < self.patience else None

    def scene(self) -> dict[str, object]:
        """Return an empty dictionary: a new viewer needs nothing before the first frame, which has the data."""
        return {}


class LiveStatics:
    """Received static transforms (/tf_static), in the form that the replay of `hric_report` uses.

    Args:
        links: names of the arm's links, in which the poses of other frames are expressed.
        on_plate: callback that gets the id of each new force plate.
    """

    def __init__(self, links: Sequence[str], on_plate: Callable[[str], None]) -> None:
        self.links, self._on_plate = set(links), on_plate
        self.known: Statics = {}

    def push(self, message: Any) -> None:
        """Store the transforms of a tf2_msgs/TFMessage."""
        for item in message.transforms:
            p, q = item.transform.translation, item.transform.rotation
            name, pose = item.child_frame_id, ([p.x, p.y, p.z], [q.x, q.y, q.z, q.w])
            fresh = name not in self.known
            self.known = {**self.known, name: (item.header.frame_id, *pose)}
            if fresh and name.startswith(PLATE_FRAME):
                self._on_plate(name.removeprefix(PLATE_FRAME))


class LiveMocap(LiveState):
    """Markers and rigid bodies of the newest frame of motion capture (hric_msgs/MocapData).

    Args:
        statics: static transforms.
    """

    def __init__(self, statics: LiveStatics) -> None:
        super().__init__()
        self._statics = statics

    def frame(self) -> dict[str, object]:
        """Return the positions of markers [m] and the poses of rigid bodies, in the frame of a link of the arm."""
        if (message := self.get()) is None:
            return {}
        parent, R, p, _ = placement(message.header.frame_id, self._statics.links, self._statics.known)
        names = [
            name or f"marker {number}"
            for name, number in zip(message.labelled_marker_names, message.labelled_marker_ids, strict=True)
        ]
        points = np.array([(m.x, m.y, m.z) for m in message.labelled_markers]).reshape(-1, 3)
        values = dict(zip(names, np.round(R.apply(points) + p, DIGITS).tolist() if len(points) else [], strict=True))
        for body in message.rigid_bodies:
            if body.tracking_valid:
                values[f"{BODY}{body.name}"] = _pose(body.pose, R, p)
        finite = {name: value for name, value in values.items() if all(map(math.isfinite, value))}
        return {"mocap": {"parent": parent, "values": finite}}


class LiveHand(LiveState):
    """End effector and external force of the newest franka_msgs/FrankaState.

    Args:
        base: name of the arm's base link, in whose frame pose and force are.
    """

    def __init__(self, base: str) -> None:
        super().__init__()
        self._base = base

    def frame(self) -> dict[str, object]:
        """Return the measured pose of the end effector (O_T_EE), and the estimated force on the arm [N] at frame K."""
        if (message := self.get()) is None:
            return {}
        T_base_ee, T_ee_k = (np.reshape(T, (4, 4), order="F") for T in (message.O_T_EE, message.EE_T_K))
        force = -np.array(message.O_F_ext_hat_K[:3])  # the message has the force of the arm on its surroundings
        if not (np.isfinite(T_base_ee).all() and np.isfinite(force).all() and T_base_ee[3, 3] == 1.0):
            return {}
        pose = np.round([*T_base_ee[:3, 3], *quaternion_from_rotation(T_base_ee[:3, :3])], DIGITS).tolist()
        point = np.round((T_base_ee @ T_ee_k)[:3, 3], DIGITS).tolist()
        force = np.round(force, FORCE_DIGITS).tolist()
        return {"hand": {"parent": self._base, "pose": pose, "point": point, "force": force}}


class LivePlates:
    """Force plates whose pose is known from static transforms, with the newest force on each.

    Args:
        statics: static transforms.
    """

    def __init__(self, statics: LiveStatics) -> None:
        self._statics, self._held = statics, dict[str, LiveState]()

    def add(self, plate: str) -> Callable[[Any], None]:
        """Add a force plate by its id, and return the callback for its geometry_msgs/WrenchStamped."""
        self._held = {**self._held, plate: LiveState()}
        return self._held[plate].push

    def scene(self) -> dict[str, object]:
        """Return an empty dictionary: each frame has the plates, since they may appear later."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return pose, size [m] and force [N] of each plate, the force in the plate's axes; force null: not known."""
        return {"plates": [plate for name, held in self._held.items() for plate in self._plate(name, held.get())]}

    def _plate(self, name: str, message: Any) -> list[dict[str, object]]:
        parent, R, p, known = placement(f"{PLATE_FRAME}{name}", self._statics.links, self._statics.known)
        if not known:
            return []
        values = () if message is None else _xyz(message.wrench.force)
        known_force = bool(values) and all(map(math.isfinite, values))
        force = [round(value, FORCE_DIGITS) for value in values] if known_force else None
        plate = {"parent": parent, "xyz": p.tolist(), "quaternion": R.as_quat().tolist(), "size": PLATE_SIZE}
        return [{"name": f"force plate {name}", "force": force, **plate}]


class LiveMuscles(LiveState):
    """Activation of the person's muscles (hric_msgs/MuscleActivation), in the order of `lines`.

    Args:
        lines: points of the line of action of each muscle: name of a link, and x, y, z in the link's frame [m].
    """

    def __init__(self, lines: Mapping[str, Sequence[Sequence[Any]]]) -> None:
        super().__init__()
        points = {name: [(str(link), tuple(map(float, p))) for link, *p in line] for name, line in lines.items()}
        unknown = np.full((1, len(points)), np.nan)
        self.lines = SceneLines(points, np.zeros(1), unknown, ACTIVATION_COLOURS, "activation of the muscles")

    def frame(self) -> dict[str, object]:
        """Return the activation of each muscle [1]; null: not known."""
        if (message := self.get()) is None:
            return {}
        activation = dict(zip(message.name, message.activation, strict=True))
        values = [activation.get(name, math.nan) for name in self.lines.points]
        return {"muscles": [round(value, FORCE_DIGITS) if math.isfinite(value) else None for value in values]}


class LiveTouches:
    """Contact load of each body region as share of its limit, the largest since the last frame; thread-safe.

    The share is the larger of force / force limit and mean pressure / pressure limit; the limits are the transient ones
    in the first TRANSIENT_TIME of a contact, then the quasi-static ones. A share below 1 is not known if force or
    pressure is not known. The verdict of `hric assess` has the same rule, and also judges the speed of the approach.

    Args:
        limits: contact limits of the body regions.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits, self._lock = limits, threading.Lock()
        self._shares: dict[str, float | None] = {}

    def push(self, message: Any) -> None:
        """Store the contacts of a hric_msgs/RegionContacts: present ones by their force, ended ones by their peak."""
        for contacts, attribute in ((message.touching, "force"), (message.ended, "peak")):
            for contact in contacts:
                share = self.share(contact, getattr(contact, attribute))
                side = next((side for side in SIDES if contact.link.startswith(f"{side[0]}_")), "")
                with self._lock:
                    for key in (key for region in contact.regions for key in region_keys(region, side)):
                        self._shares[key] = _worse(self._shares[key], share) if key in self._shares else share

    def share(self, contact: Any, force: float) -> float | None:
        """Return the load of a contact as share of its limit [1]; None: not known; 1: no contact is permitted there.

        Args:
            contact: hric_msgs/RegionContact with the regions and the area.
            force: force of the contact [N].
        """
        limit = self._limits.at(contact.regions, dominant=bool(contact.dominant)) if contact.regions else None
        if limit is None or not math.isfinite(force):
            return None
        if not limit.permitted:
            return 1.0
        short, ratios = contact.duration < TRANSIENT_TIME, list[float | None]()
        area = contact.area if contact.area > 0.0 else math.nan
        for pair, value in ((limit.force, force), (limit.pressure, force / area)):
            bound = None if pair is None else pair.transient if short else pair.quasi_static
            if bound is not None:
                ratios.append(value / bound if math.isfinite(value) else None)
        worst = reduce(_worse, ratios) if ratios else None
        return None if worst is None else round(worst, FORCE_DIGITS)

    def scene(self) -> dict[str, object]:
        """Return an empty dictionary: a new viewer needs nothing before the first frame, which has the shares."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return the largest share of the limit since the last call [1], by body region; null: not known."""
        with self._lock:
            shares, self._shares = self._shares, {}
        return {"touched": shares}


def _worse(a: float | None, b: float | None) -> float | None:
    """Return the worse of two shares of a limit [1]; None (not known) is worse than a share below 1."""
    known = max((share for share in (a, b) if share is not None), default=None)
    return known if known is None or known >= 1.0 or None not in (a, b) else None


def _xyz(v: Any) -> tuple[float, float, float]:
    return v.x, v.y, v.z


def _pose(pose: Any, R: Rotation, p: Any) -> list[float]:
    """Return a geometry_msgs/Pose after the transform R, p: x, y, z [m] and quaternion x, y, z, w.

    A pose whose quaternion is far from unit length gives a single NaN.
    """
    q = pose.orientation
    quaternion = (q.x, q.y, q.z, q.w)
    if not 0.5 < math.hypot(*quaternion) < 2.0:
        return [math.nan]
    xyz = R.apply(_xyz(pose.position)) + p
    return np.round([*xyz, *(R * Rotation.from_quat(quaternion)).as_quat()], DIGITS).tolist()  # type: ignore[no-any-return]
