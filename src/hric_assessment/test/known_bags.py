"""Ten bags whose findings are known before anybody assesses them: signals from closed forms, written by rosbags.

Nothing of the package under test is used here. Beside each bag is what has to be found, with the arithmetic of it. As a
program it writes all of them:   python3 known_bags.py DIR
"""

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

MESSAGES = Path(__file__).parents[2] / "hric_msgs" / "msg"
STORE = get_typestore(Stores.ROS1_NOETIC)
for _name in ("ControlLog", "JointTorque", "RegionContact", "RegionContacts", "MuscleActivation", "PersonTracking"):
    STORE.register(get_types_from_msg((MESSAGES / f"{_name}.msg").read_text(), f"hric_msgs/msg/{_name}"))
STORE.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
ARM = ("right_sh_flex", "right_sh_abd", "right_sh_rot", "right_el_flex", "right_pro_sup", "right_wr_flex")
HAND, SKULL = "hand, fingers", "skull, forehead"
AREA = 4e-4
"""Contact area [m^2]."""
NEAREST_Y = -0.60
"""How far to the left of the middle of the shoulders the ball passes: to the right, beside the right arm [m]."""
BALL = 0.05
"""Radius of the ball [m]."""


@dataclass(frozen=True)
class Known:
    """Bag whose verdict is known, with the expected findings.

    Attributes:
        name: name of the bag.
        options: options of `assess`.
        group: group of the findings that are compared.
        outcomes: expected outcomes of these findings, by their index.
        values: expected values of the first finding, by the beginning of the name; its share is called "share".
        figures: expected figures of the verdict, by name.
        reason: words in the reason of the first finding.
        missing: words in the list of missing signals.
        code: exit code; None: other groups influence it.
    """

    name: str
    options: tuple[str, ...] = ()
    group: str = "contact"
    outcomes: tuple[str, ...] = ()
    values: dict[str, float] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    reason: str = ""
    missing: tuple[str, ...] = ()
    code: int | None = None


class Bag:
    """A bag that is written."""

    def __init__(self, path: Path) -> None:
        self._writer, self._connections = Writer(path), dict[str, Any]()

    def __enter__(self) -> "Bag":
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def write(self, topic: str, kind: str, at: float, /, **values: Any) -> None:
        """Write a message; at: time of recording and stamp of its header [s]."""
        stamped = {"header": header(at)} if kind.startswith(("hric", "sensor")) else {}
        message = made(kind, **{**stamped, **values})
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=STORE)
        self._writer.write(self._connections[topic], round(at * 1e9), STORE.serialize_ros1(message, kind))


def made(message_type: str, /, **values: Any) -> Any:
    return STORE.types[message_type](**values)


def header(time: float, frame: str = "world") -> Any:
    seconds, nanoseconds = divmod(round(time * 1e9), 10**9)
    stamp = made("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return made("std_msgs/msg/Header", seq=0, stamp=stamp, frame_id=frame)


def joints(bag: Bag, times: Iterable[float], angles: dict[str, float], torque: bool = True) -> None:
    """A person who holds still."""
    names, q = list(angles), np.array(list(angles.values()))
    zeros = np.zeros(len(names))
    for time in times:
        still = {"position": q, "velocity": zeros, "effort": zeros}
        bag.write("/hric/human/joint_states", "sensor_msgs/msg/JointState", time, name=names, **still)
        if torque:
            nothing = {"at_strength": zeros.astype(bool), "clipped": zeros.astype(np.uint32)}
            load = {"torque": zeros, "strength_share": zeros, **nothing}
            bag.write("/hric/human/joint_torque", "hric_msgs/msg/JointTorque", time, name=names, **load)


def upright(bag: Bag, height: float, base: Sequence[tuple[str, str, float]] = ()) -> None:
    """A root link that stands at a height [m]; base: parent, child and distance along x [m] of further frames."""
    frames(bag, 0.0, ("world", "human_base", 0.0, height), *((*frame, 0.0) for frame in base))


def frames(bag: Bag, at: float, *placed_frames: tuple[str, str, float, float], topic: str = "/tf_static") -> None:
    """Frames in tf; placed_frames: parent, child, and distances along x and z [m]."""
    placed = []
    for parent, child, x, z in placed_frames:
        place = made("geometry_msgs/msg/Vector3", x=x, y=0.0, z=z)
        turn = made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        transform = made("geometry_msgs/msg/Transform", translation=place, rotation=turn)
        kind, about = "geometry_msgs/msg/TransformStamped", {"child_frame_id": child, "transform": transform}
        placed.append(made(kind, header=header(at, parent), **about))
    bag.write(topic, "tf2_msgs/msg/TFMessage", at, transforms=placed)


def contact(
    path: Path, region: str, force: Callable[[float], float], begin: float, end: float, kind: str = "penalty"
) -> None:
    """One contact, 1000 messages a second; force: from the time since the begin [s] to [N]."""
    xyz = {"x": math.nan, "y": math.nan, "z": math.nan}
    point, normal = made("geometry_msgs/msg/Point", **xyz), made("geometry_msgs/msg/Vector3", **xyz)
    places = {"point": point, "begin_point": point, "normal": normal, "begin_normal": normal}
    with Bag(path) as bag:
        joints(bag, np.arange(0.0, end + 0.5, 0.02), dict.fromkeys(ARM, 0.0))
        peak, peak_time, impulse = 0.0, begin, 0.0
        for k in range(round((end - begin) * 1000.0) + 1):
            time = begin + 0.001 * k
            now = force(0.001 * k) if kind == "penalty" else math.nan
            impulse += 0.001 * now
            if now > peak:
                peak, peak_time = now, time
            numbers = {"force": now, "peak": peak, "peak_time": peak_time, "impulse": impulse, "area": math.nan}
            if kind != "penalty":
                numbers |= dict.fromkeys(("peak", "peak_time", "impulse"), math.nan)
            about = {"regions": [region], "dominant": False, "link": "met", "other": "robot::tool", "kind": kind}
            one = made(
                "hric_msgs/msg/RegionContact",
                **about,
                begin=begin,
                duration=time - begin,
                begin_speed=math.nan,
                energy=math.nan,
                **numbers,
                **places,
            )
            last = time >= end - 1e-9
            lists = {"touching": [] if last else [one], "ended": [one] if last else []}
            bag.write("/hric/human/contacts", "hric_msgs/msg/RegionContacts", time, **lists)


def half_sine(peak: float, duration: float) -> Callable[[float], float]:
    """Return a half-sine force [N] over time [s]."""
    return lambda t: peak * math.sin(math.pi * min(max(t / duration, 0.0), 1.0))


def held(peak: float, level: float) -> Callable[[float], float]:
    """A blow of 20 ms, then a clamp of a level, [N]."""
    return lambda t: max(half_sine(peak, 0.02)(t) if t < 0.02 else 0.0, level)


def contacts(folder: Path) -> list[Known]:
    """1 to 6. Limits of ISO/TS 15066 for hand and fingers: 280 N transient, 140 N quasi-static; the lowest pressure of
    its areas (back of the other hand) 190 N/cm^2 quasi-static, so 380 N/cm^2 transient."""
    area = ("--contact-area", str(AREA))
    blow, clamp = half_sine(200.0, 0.02), held(200.0, 168.0)
    contact(folder / "within.bag", HAND, blow, 1.0, 1.02)
    contact(folder / "above.bag", HAND, half_sine(350.0, 0.02), 1.0, 1.02)
    contact(folder / "clamped.bag", HAND, clamp, 1.0, 3.0)
    contact(folder / "head.bag", SKULL, half_sine(5.0, 0.02), 1.0, 1.02)
    contact(folder / "rigid.bag", HAND, blow, 1.0, 1.02, kind="rigid")
    contact(folder / "no_area.bag", HAND, blow, 1.0, 1.02)
    return [
        Known(
            "within",
            area,
            outcomes=("within limits",),
            values={"share": 200.0 / 280.0, "transient peak": 200.0, "transient mean pressure": 200.0 / AREA},
        ),
        Known("above", area, outcomes=("above limits",), values={"share": 350.0 / 280.0}, code=3),
        Known("clamped", area, outcomes=("above limits",), values={"share": 168.0 / 140.0}, code=3),
        Known("head", area, outcomes=("above limits",), code=3),
        Known("rigid", area, outcomes=("not assessable",), reason="rigid", code=4),
        Known("no_area", outcomes=("not assessable",), reason="pressure not assessable", code=4),
    ]


def ball_urdf(root: str = "world", more: str = "") -> str:
    """A ball on a rail along x, beside the shoulders and 0.2 m below them; more: further elements of the robot."""
    ball = f'<geometry><sphere radius="{BALL}"/></geometry>'
    rail = f'<origin xyz="0 {NEAREST_Y} 1.2"/><parent link="{root}"/><child link="tool"/><axis xyz="1 0 0"/>'
    limit = '<limit lower="-3" upper="3" effort="100" velocity="5"/>'
    return (
        f'<robot name="ball"><link name="{root}"/><link name="tool"><collision>{ball}</collision></link>'
        f'<joint name="rail" type="prismatic">{rail}{limit}</joint>{more}</robot>'
    )


def approach(
    folder: Path,
    seen: Callable[[float], bool] = lambda time: True,
    urdf: str = ball_urdf(),
    base: Sequence[tuple[str, str, float]] = (),
    more: Callable[[Bag], None] = lambda bag: None,
    parts: str = "right_arm",
    measured: Callable[[np.ndarray], np.ndarray] = lambda times: times,
) -> Known:
    """7. The ball passes a hanging arm at a constant speed. Nearest is where a closed form of point and line has it.

    Args:
        folder: folder of the bag.
        seen: whether the joint states of a time [s] are recorded.
        urdf: description of the robot.
        base: frames from the world to the root of the description, see `upright`.
        more: writes further messages.
        parts: parts of the body of which the joints are recorded.
        measured: function from times to those whose position the log has [s].
    """
    speed, begin = 0.8, -1.6
    times = np.arange(0.0, 4.0005, 0.001)
    x = begin + speed * measured(times)
    body = describe(HumanSettings.of({"parts": parts}, "human").person)
    with Bag(folder / "approach.bag") as bag:
        bag.write("/robot_description", "std_msgs/msg/String", 0.0, data=urdf)
        upright(bag, 1.4, base)
        joints(bag, filter(seen, times[::20]), dict.fromkeys(body.joints, 0.0))
        more(bag)
        for k in range(0, len(times) - 1, 20):
            part = slice(k, k + 20)
            rows = {"position": x[part] - sum(frame[-1] for frame in base), "velocity": np.full(20, speed)}
            rows |= dict.fromkeys(("effort", "command_raw", "command"), np.zeros(20))
            about = {"joint_names": ["rail"], "command_interface": ["none"], "first_cycle": k, "n_cycles": 20}
            bag.write("/control_log", "hric_msgs/msg/ControlLog", float(times[k]), **about, time=times[part], **rows)
    smallest, at = nearest(body, x)
    s_p = 1.6 * (0.1 + 0.3) + speed * (0.1 + 0.3)  # above 0.5 m, so that the person walks; without data of the braking
    return Known(
        "approach",
        group="separation",
        outcomes=("above limits",),
        values={"smallest distance": smallest, "when": float(times[at]), "S_p": s_p, "share": s_p / smallest},
        code=3,
    )


def nearest(body: Any, x: np.ndarray) -> tuple[float, int]:
    """(smallest distance [m], its index) of the ball from the capsules of an arm that hangs at zero angles."""
    model = pinocchio.buildModelFromXML(body.urdf)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    ball = np.stack([x, np.full_like(x, NEAREST_Y), np.full_like(x, 1.2)], axis=1)
    found = np.full(len(x), np.inf)
    for segment in body.segments.values():
        placed = data.oMf[model.getFrameId(segment.link)]
        a, b = (placed.act(np.array(end)) + np.array([0.0, 0.0, 1.4]) for end in segment.straight)
        along = np.clip((ball - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0.0, 1.0)
        apart = np.linalg.norm(ball - a - along[:, None] * (b - a), axis=1) - segment.radius - BALL
        found = np.minimum(found, apart)
    return float(found.min()), int(found.argmin())


def posture(folder: Path) -> Known:
    """8. A still body.

    RULA of the right arm: upper arm 50 deg is 3, elbow 80 deg 1, wrist 10 deg 2, twist 1: table A 4; neck 15 deg is 2,
    trunk 10 deg 2, legs 1: table B 2; table C of 4 and 2 is 3. REBA: neck 1, trunk 2, legs 1: table A 2; upper arm 3,
    lower arm 1, wrist 1: table B 3; table C of 2 and 3 is 2. RULA of the left arm: upper arm 1, elbow 80 deg 1, wrist
    1, twist 1: table A 1; table C of 1 and 2 is 2.
    """
    body = describe(HumanSettings.of({"parts": "whole_body"}, "human").person)
    angles = dict.fromkeys(body.joints, 0.0)
    degrees = {"right_sh_flex": 50.0, "right_el_flex": 80.0, "right_wr_flex": 10.0, "left_el_flex": 80.0}
    degrees |= {"neck_flex": 15.0, "trunk_flex": 10.0}
    angles |= {name: math.radians(value) for name, value in degrees.items()}
    with Bag(folder / "posture.bag") as bag:
        upright(bag, 0.95)
        joints(bag, np.arange(0.0, 4.0, 0.02), angles)
    return Known("posture", group="posture", outcomes=("warning",), values={"score that counts": 3.0})


def sweep(folder: Path) -> Known:
    """9. One muscle from 0 to 1 in ten seconds, another at rest."""
    times = np.arange(0.0, 10.0001, 0.01)
    with Bag(folder / "sweep.bag") as bag:
        for time in times:
            a = np.array([time / 10.0, 0.0])
            rest = {"at_limit": np.zeros(2, dtype=bool), "limited": np.zeros(2, dtype=np.uint32)}
            names = ["biceps", "triceps"]
            kind = "hric_msgs/msg/MuscleActivation"
            bag.write("/hric/human/activation", kind, float(time), name=names, excitation=a, activation=a, **rest)
    return Known(
        "sweep",
        group="muscles",
        figures={
            "largest activation": 1.0,
            "mean activation of all muscles": 0.25,
            "share of time with a muscle above 0.3": 0.7,
            "share of time with a muscle above 0.5": 0.5,
        },
        code=4,
    )


def nothing(folder: Path) -> Known:
    """10. A robot's joints alone."""
    names = [f"panda_joint{k}" for k in range(1, 8)]
    zeros = np.zeros(7)
    with Bag(folder / "nothing.bag") as bag:
        for time in np.arange(0.0, 1.0, 0.01):
            values = {"position": zeros, "velocity": zeros, "effort": zeros}
            bag.write("/joint_states", "sensor_msgs/msg/JointState", float(time), name=names, **values)
    words = ("joint angles of a person", "contacts of a person", "control_log", "description", "activation")
    return Known("nothing", group="", missing=words, code=4)


def write(folder: Path) -> Sequence[Known]:
    """All ten."""
    return [*contacts(folder), approach(folder), posture(folder), sweep(folder), nothing(folder)]


if __name__ == "__main__":
    for known in write(Path(sys.argv[1])):
        print(f"{known.name}.bag: {known}")
