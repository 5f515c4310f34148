"""The publishing process: builds and sends the messages of a robot process, so that its control loop shares its interpreter with no publisher.

Started by `publish_process`; not for users. It ends when the robot process has closed its pipe, however that came about.
"""

from __future__ import annotations

import os
import select
import signal
import sys
from collections.abc import Callable
from typing import Any

import rospy
from rospy.impl import simtime

from hric_control import ros_backlog
from hric_control.publish_channel import MAX_TOPICS, Counters, FrameReader, frame
from hric_control.ros_node import RosPublisher

COUNT_EVERY = 0.05
"""How often listeners are counted while nothing comes [s]."""


class PublishServer:
    """Serves one pipe.

    Args:
        requests: reading end: ("advertise", topic, name, message type, latch), ("unregister", topic), (topic, build, args).
        replies: writing end: ("done", topic, error text or "") for the first, ("failed", topic, text) at the first failure of a topic.
        counters: shared page.
    """

    def __init__(self, requests: int, replies: int, counters: Counters) -> None:
        self._requests, self._replies, self._counters = requests, replies, counters
        self._reader = FrameReader(requests)
        self._publishers: dict[int, RosPublisher] = {}
        self._failed: set[int] = set()
        self._waiting: dict[int, list[Any]] = {}

    def run(self) -> None:
        """Serve until the pipe ends."""
        consumed = 0
        while True:
            self._count()
            if not select.select([self._requests], [], [], COUNT_EVERY)[0]:
                continue
            frames = self._reader.read()
            if frames is None:
                return
            for content, size in frames:
                self._serve(content)
                consumed += size
            self._send()
            self._counters.consumed = consumed

    def _count(self) -> None:
        for topic, publisher in self._publishers.items():
            if topic < MAX_TOPICS:
                self._counters.set_listeners(topic, publisher.subscribers())

    def _serve(self, content: tuple[Any, ...]) -> None:
        if content[0] == "advertise":
            self._advertise(*content[1:])
        elif content[0] == "unregister":
            self._send()
            self._publishers.pop(content[1]).unregister()
        else:
            self._build(*content)

    def _advertise(self, topic: int, name: str, message_type: type, latch: bool) -> None:
        try:
            self._publishers[topic] = RosPublisher(name, message_type, 0, latch)
        except Exception as error:  # told to whoever asked; the other topics go on
            self._reply("done", topic, f"topic {name} cannot be advertised: {error}")
        else:
            self._reply("done", topic, "")

    def _build(self, topic: int, build: Callable[..., Any], args: tuple[Any, ...]) -> None:
        try:
            self._waiting.setdefault(topic, []).append(build(*args))
        except Exception as error:  # whatever a builder does, the other topics go on
            self._report(topic, error)

    def _send(self) -> None:
        """What came together goes out together, topic by topic."""
        waiting, self._waiting = self._waiting, {}
        for topic, messages in waiting.items():
            try:
                self._publishers[topic].publish_all(messages)
            except Exception as error:  # a message that cannot be sent must not keep the others
                self._report(topic, error)

    def _report(self, topic: int, error: Exception) -> None:
        """The first failure of a topic is told."""
        if topic not in self._failed:
            self._failed.add(topic)
            self._reply("failed", topic, f"message could not be sent: {type(error).__name__}: {error}")

    def _reply(self, *content: Any) -> None:
        os.write(self._replies, frame(content))


def main(name: str, requests: int, replies: int, page: int) -> None:
    """Run the process.

    Args:
        name: name of its node, without namespace.
        requests, replies, page: descriptors.
    """
    for number in (signal.SIGINT, signal.SIGTERM):  # of the whole group; the last messages come after them
        signal.signal(number, signal.SIG_IGN)
    simtime._is_use_simtime = lambda: False  # it has no use for the time; see ros_time
    rospy.init_node(name, argv=[], disable_signals=True)
    ros_backlog.widen()
    # rospy has told the master by then; what it does after that is to wait half a second for threads that end with the process.
    rospy.core.add_preshutdown_hook(lambda reason: os._exit(0))
    PublishServer(requests, replies, Counters(page)).run()
    rospy.signal_shutdown("the robot process has ended")


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:5]))
