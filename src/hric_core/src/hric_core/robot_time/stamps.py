"""Between float seconds of robot time and the time stamps of messages."""

import genpy

_NS = 1_000_000_000

FIRST = genpy.Time(0, 1)
"""The earliest time that ROS takes for one: to ROS, 0 means that there is no time yet, and tools such as rosbag record
wait."""


def to_time(seconds: float) -> genpy.Time:
    """Stamp for a robot time.

    Args:
        seconds: robot time, not negative [s]; rounded to the nanosecond (genpy's own conversion truncates, so 1.001 s
            would lose one).
    """
    nanoseconds = round(seconds * _NS)
    if nanoseconds < 0:
        return genpy.Time(nanoseconds // _NS, nanoseconds % _NS)  # which refuses it
    stamp: genpy.Time = object.__new__(
        genpy.Time
    )  # genpy's constructor looks at both numbers again, for as long as all the rest takes
    stamp.secs, stamp.nsecs = nanoseconds // _NS, nanoseconds % _NS
    return stamp


def to_duration(seconds: float) -> genpy.Duration:
    """Duration message field for a time span [s], rounded to the nanosecond."""
    nanoseconds = round(seconds * _NS)
    return genpy.Duration(nanoseconds // _NS, nanoseconds % _NS)
