"""Bags whose verdict is known beforehand: what is not in a recording, or cannot be, and a contact that is.

Written by rosbags from the message files alone; nothing of the package under test is used here.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MESSAGES = Path(__file__).parents[2] / "hric_msgs" / "msg"
STORE = get_typestore(Stores.ROS1_NOETIC)
for _name in ("ControlLog", "JointTorque", "RegionContact", "RegionContacts", "HumanGrip"):
    STORE.register(get_types_from_msg((MESSAGES / f"{_name}.msg").read_text(), f"hric_msgs/msg/{_name}"))
RIGHT = [f"right_{name}" for name in ("sh_flex", "sh_abd", "sh_rot", "el_flex", "pro_sup", "wr_flex", "wr_dev")]
TRUNK = [f"{part}_{name}" for part in ("trunk", "neck") for name in ("flex", "bend", "rot")]
LEG = ("hip_flex", "hip_abd", "hip_rot", "knee_flex", "ankle_flex", "ankle_inv")
LEGS = [f"{side}_{name}" for side in ("right", "left") for name in LEG]
WHOLE = [*TRUNK, *RIGHT, *(name.replace("right", "left") for name in RIGHT), *LEGS]
HAND = "hand, fingers"
AREA = 4e-4
"""Contact area [m^2]."""
Force = Callable[[float], float]
"""Time since the begin of a contact [s] -> force [N]."""


def half_sine(peak: float, duration: float = 0.02) -> Force:
    return lambda t: peak * math.sin(math.pi * min(max(t / duration, 0.0), 1.0))


def held(level: float) -> Force:
    return lambda t: level


@dataclass
class Bag:
    """Messages that become a bag.

    Attributes:
        rows: time [s], topic, kind and message.
        lost: function of time [s] and topic: True if the message is counted but left out of the bag.
        node: node that publishes the following messages; empty: not stated in the bag.
    """

    rows: list[tuple[float, str, str, Any]] = field(default_factory=list)
    lost: Callable[[float, str], bool] = lambda at, topic: False
    node: str = ""
    nodes: dict[int, str] = field(default_factory=dict)

    def put(self, at: float, topic: str, kind: str, stamp: float | None = None, **values: Any) -> None:
        """Add a message; at: time of recording, stamp: that of its header where it is another [s]."""
        header = made_header(at if stamp is None else stamp)
        self.rows.append((at, topic, kind, STORE.types[kind](header=header, **values)))
        self.nodes[id(self.rows[-1][-1])] = self.node

    def save(self, path: Path, numbered: bool | None = False) -> Path:
        """Write the bag; numbered: with sequence numbers from 1 on, False: all are 0, None: as they are."""
        path.unlink(missing_ok=True)
        counts: dict[tuple[str, str], int] = {}
        with Writer(path) as writer:
            connections: dict[tuple[str, str], Any] = {}
            for at, topic, kind, message in sorted(self.rows, key=lambda row: row[0]):
                key = topic, self.nodes[id(message)]
                if key not in connections:
                    connections[key] = writer.add_connection(topic, kind, typestore=STORE, callerid=key[1] or None)
                counts[key] = counts.get(key, 0) + 1
                if numbered is not None:
                    message.header.seq = counts[key] if numbered else 0
                if self.lost(at, topic):
                    continue
                writer.write(connections[key], round(at * 1e9), STORE.serialize_ros1(message, kind))
        return path

    def person(
        self,
        begin: float,
        end: float,
        names: Sequence[str] = RIGHT,
        degrees: Mapping[str, float] = {},
        *,
        torque: bool = True,
        rate: float = 50.0,
        name: str = "/hric/human",
    ) -> None:
        """A person who holds still, the elbows at 80 degrees."""
        zeros = np.zeros(len(names))
        q = np.radians([degrees.get(joint, 80.0 if joint.endswith("el_flex") else 0.0) for joint in names])
        for at in np.arange(begin, end, 1.0 / rate):
            still = {"name": names, "position": q, "velocity": zeros, "effort": zeros}
            self.put(at, f"{name}/joint_states", "sensor_msgs/msg/JointState", **still)
            if torque:
                load = {"torque": zeros, "strength_share": zeros, "at_strength": zeros.astype(bool)}
                load |= {"name": names, "clipped": zeros.astype(np.uint32)}
                self.put(at, f"{name}/joint_torque", "hric_msgs/msg/JointTorque", **load)

    def control_log(self, begin: float, end: float, speed: float = 0.0) -> None:
        """Log of an arm whose joints turn at a speed [rad/s], 20 cycles in each message."""
        zeros = np.zeros(140)
        about = {"joint_names": [f"panda_joint{k + 1}" for k in range(7)], "command_interface": ["effort"] * 7}
        about |= {"n_cycles": 20} | dict.fromkeys(("position", "velocity", "effort", "command_raw", "command"), zeros)
        for k in range(round(50.0 * (end - begin))):
            at, cycles = begin + 0.02 * k, np.arange(20 * k, 20 * k + 20)
            time = begin + 0.001 * cycles
            moved = {"position": np.repeat(speed * (time - begin), 7), "velocity": np.full(140, speed)}
            row = {**about, **moved, "first_cycle": 20 * k, "time": time}
            self.put(at, "/control_log", "hric_msgs/msg/ControlLog", **row)

    def silence(self, begin: float, end: float, rate: float = 20.0) -> None:
        """Messages of contacts in which nothing touches."""
        for at in np.arange(begin, end, 1.0 / rate):
            self.put(at, "/hric/human/contacts", "hric_msgs/msg/RegionContacts", touching=[], ended=[])

    def grip(self, at: float, force: float) -> None:
        """A message of a closed grip of a box by the right hand; force: on the hand [N]."""
        x_y_z = {"x": force, "y": 0.0, "z": 0.0}
        pull, zero = (STORE.types["geometry_msgs/msg/Vector3"](**axes) for axes in (x_y_z, dict.fromkeys("xyz", 0.0)))
        wrench = STORE.types["geometry_msgs/msg/Wrench"](force=pull, torque=zero)
        about = {"name": "right", "held": "box::handle", "holder": "human::r_wrist", "closed": True, "wrench": wrench}
        about |= {"point": STORE.types["geometry_msgs/msg/Point"](x=0.3, y=0.2, z=1.0)}
        about |= dict.fromkeys(("stretch", "slipped", "turned"), 0.0)
        self.put(at, "/hric/human/grip", "hric_msgs/msg/HumanGrip", **about)

    def contact(
        self,
        force: Force,
        start: float,
        stop: float,
        *,
        rate: float = 1000.0,
        recorded: Callable[[float], bool] = lambda time: True,
        ends: bool = True,
        **about: Any,
    ) -> None:
        """Messages of one contact.

        Args:
            force: force as a function of the time since the begin.
            start, stop: begin and end of the contact [s].
            rate: rate of the messages and of the source's evaluations [Hz].
            recorded: function of time [s]: True if the message is in the bag.
            ends: True if a message states that the contact ended.
            about: fields of the message in place of those below; `peak` and `impulse` follow from the force.
        """
        nan = {"x": math.nan, "y": math.nan, "z": math.nan}
        point, normal = STORE.types["geometry_msgs/msg/Point"](**nan), STORE.types["geometry_msgs/msg/Vector3"](**nan)
        fields = {"regions": [HAND], "dominant": True, "link": "r_wrist", "other": "panda::panda_hand"}
        fields |= {"kind": "penalty", "begin": start, "area": math.nan, "begin_speed": math.nan}
        fields |= {"energy": math.nan}
        fields |= {"point": point, "normal": normal, "begin_point": point, "begin_normal": normal, **about}
        peak, peak_time, impulse, count = 0.0, start, 0.0, round((stop - start) * rate)
        for k in range(count + 1):
            at, now = start + k / rate, force(k / rate)
            impulse += now / rate
            if not now <= peak:  # NaN, too
                peak, peak_time = now, at
            if not recorded(at):
                continue
            values = {"duration": at - start, "force": now, "peak": peak, "peak_time": peak_time, "impulse": impulse}
            contact = STORE.types["hric_msgs/msg/RegionContact"](**{**values, **fields})
            last = ends and k == count
            lists = {"touching": [] if last else [contact], "ended": [contact] if last else []}
            self.put(at, "/hric/human/contacts", "hric_msgs/msg/RegionContacts", **lists)


def made_header(time: float) -> Any:
    seconds, nanoseconds = divmod(round(time * 1e9), 10**9)
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return STORE.types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="world")
