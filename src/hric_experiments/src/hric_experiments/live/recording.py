"""Recording of a live experiment: waits until a recorder runs and has subscribed, and stops it."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import String

from hric_bags.run_folder import RunFolder
from hric_experiments.live import node as live_node
from hric_experiments.live import topics
from hric_experiments.recorder.node import RECORDING_TOPIC, START_SERVICE, STOP_SERVICE, TRIGGER_TOPIC

TRIGGERS = f"the topic {TRIGGER_TOPIC} or the service {START_SERVICE}"
"""Topic and service that start an armed recorder."""
RECORDER_TIMEOUT = 120.0
"""Maximum wait for the recorder to close its bag [s of wall time]; long enough for gigabytes on a slow disk."""


class LiveRecording:
    """Recorder in this node's namespace, and the run folder into which it records."""

    def __init__(self) -> None:
        self._recorder = self._folder = ""
        self._subscriber = rospy.Subscriber(RECORDING_TOPIC, String, self._on_recording)

    def _on_recording(self, message: Any) -> None:
        self._recorder, self._folder = message._connection_header["callerid"], message.data

    def missing(self) -> list[str]:
        """Return the topic on which no recorder has reported a recording yet; empty: it records."""
        return [] if self._folder else [RECORDING_TOPIC]

    @property
    def folder(self) -> RunFolder:
        """Run folder, as soon as nothing is missing."""
        return RunFolder(Path(self._folder))

    def unrecorded(self, nodes: Iterable[str]) -> set[str]:
        """Return the topics of these nodes to which the recorder still has to subscribe."""
        return set().union(*(topics.unrecorded(self._recorder, node) for node in nodes))

    def stop(self) -> RunFolder:
        """Stop the recording and return its run folder. Raises FailureError."""
        bag = live_node.trigger(
            STOP_SERVICE, "the recorder does not respond", "the recording could not be stopped", RECORDER_TIMEOUT
        )
        self._subscriber.unregister()  # the next recording is not of this experiment
        self._folder = str(Path(bag).parent)
        return self.folder
