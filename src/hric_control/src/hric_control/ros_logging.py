"""From Python's logging to rosout, so that what the pure core says is seen by ROS users."""

from __future__ import annotations

import logging

import rospy


class _RosHandler(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        if record.levelno >= logging.ERROR:
            rospy.logerr(text)
        elif record.levelno >= logging.WARNING:
            rospy.logwarn(text)
        else:
            rospy.loginfo(text)


def forward_to_ros(logger: logging.Logger) -> None:
    """Send what `logger` says to rosout instead of the terminal alone. After `rospy.init_node`.

    Meant for rare messages: rosout is written in the calling thread.
    """
    logger.setLevel(logging.INFO)
    logger.propagate = False
    if not any(isinstance(handler, _RosHandler) for handler in logger.handlers):
        logger.addHandler(_RosHandler())
