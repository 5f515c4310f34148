"""Conversion of robot time in seconds to the time stamps of messages."""

import genpy

_NS = 1_000_000_000

FIRST = genpy.Time(0, 1)
"""Smallest valid ROS time. At time 0, tools such as rosbag record assume that there is no time yet, and wait."""


def to_time(seconds: float) -> genpy.Time:
    """Return a robot time as message stamp.

    Args:
        seconds: robot time, not negative [s]; it is rounded to the nanosecond (genpy's own conversion truncates, which
            makes 1.001 s a nanosecond too small).
    """
    nanoseconds = round(seconds * _NS)
    if nanoseconds < 0:
        return genpy.Time(nanoseconds // _NS, nanoseconds % _NS)  # raises an error
    stamp: genpy.Time = object.__new__(
        genpy.Time
    )  # genpy's constructor checks both numbers again, which doubles the time
    stamp.secs, stamp.nsecs = nanoseconds // _NS, nanoseconds % _NS
    return stamp


def to_duration(seconds: float) -> genpy.Duration:
    """Return a time span [s] as genpy.Duration, rounded to the nanosecond."""
    nanoseconds = round(seconds * _NS)
    return genpy.Duration(nanoseconds // _NS, nanoseconds % _NS)
