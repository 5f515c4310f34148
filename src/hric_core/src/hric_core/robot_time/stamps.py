"""Conversion of robot time in seconds to the time stamps of messages."""

import genpy

_NS = 1_000_000_000

FIRST = genpy.Time(0, 1)
"""Smallest valid ROS time: 0 means that there is no time yet, for which tools such as rosbag record wait."""


def to_time(seconds: float) -> genpy.Time:
    """Return the stamp of a robot time.

    Args:
        seconds: robot time, not negative [s]; rounded to the nanosecond (genpy's own conversion truncates, so 1.001 s
            would lose one).
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
    """Return the duration of a time span [s], rounded to the nanosecond."""
    nanoseconds = round(seconds * _NS)
    return genpy.Duration(nanoseconds // _NS, nanoseconds % _NS)
