"""Node `person`: joint positions of a real person from motion capture markers, and the load of their muscles."""

import threading
import time
from typing import Any, NamedTuple

from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage

from hric_core.errors import CommandError, HricError
from hric_core.geometry import FloatArray
from hric_core.realtime import LatestValue
from hric_core.robot_time.follower import RobotTime
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp
from hric_human.body import Body
from hric_motion.live_load import LiveLoad
from hric_motion.tracking import LOST, PersonEstimate, PersonTracker, StillPose, calibrate
from hric_msgs.msg import MocapData, PersonTracking
from hric_perception.person.frames import PERSON, BodyMessages, PersonMarkers
from hric_perception.person.load import LoadThread, TrackerFrame
from hric_perception.person.settings import PersonSettings
from hric_perception.sensor import Reporter
from hric_perception.stream import ERROR, OK, START, WARN, StreamReport

FRAMES = "hric/perception/mocap"
TF_RATE = 30.0
"""Rate of the person's tf frames, for visualisation [Hz of the stamps].

The constants of this file are project defaults, unconfirmed.
"""
PATIENCE = 5.0
"""Longest time that a calibration waits for the next mocap frame [s of wall time]."""
WAIT = 0.1
"""Time between checks whether the node shuts down [s]."""


class _Known(NamedTuple):
    """Tracker, message converter and muscle load of one body model."""

    tracker: PersonTracker
    messages: BodyMessages
    live: LiveLoad

    @classmethod
    def of(cls, body: Body, calibrated: bool, settings: PersonSettings) -> "_Known":
        live = LiveLoad(body, None, settings.side)
        return cls(PersonTracker(body, settings.worn), BodyMessages(body, calibrated), live)


class PersonNode(NodeApp):
    """Node that tracks a person from construction on; of the mocap frames that wait, only the newest is used.

    Args:
        node: private node.

    Raises:
        HricError: a parameter or the calibration file is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        self._node, self._settings = node, PersonSettings.read(node)
        self._names = self._settings.worn
        body, calibrated = self._settings.known()
        self._known = LatestValue(_Known.of(body, calibrated, self._settings))
        self._rows = PersonMarkers(self._names, self._settings.labels, self._settings.asset)
        where = node.beside(f"hric/{PERSON}")
        self._states = node.advertise(f"{where}/joint_states", JointState, queue_size=10)
        self._tracking = node.advertise(f"{where}/tracking", PersonTracking, queue_size=10)
        self._tf = node.advertise("/tf", TFMessage, queue_size=10)
        node.set_param(f"{where}/robot_description", body.urdf)
        self._reporter, self._health = Reporter(node, "tracking"), _Tally(calibrated)
        self._load_reporter, self._robot_time = Reporter(node, "load"), RobotTime(node)
        self._load = LoadThread(node, where, self._settings.force, self._settings.side, self._robot_time.now)
        self._newest: LatestValue[Any] = LatestValue(None)
        self._came, self._stop = threading.Event(), threading.Event()
        self._next_tf = 0.0
        self._still: StillPose | None = None
        self._still_done, self._calibrating = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._run, name="tracking", daemon=True)
        self._thread.start()
        node.service("calibrate", Trigger, self._on_calibrate)
        node.subscribe(node.beside(FRAMES), MocapData, self._on_frame, queue_size=1)

    def tick(self) -> None:
        """Publish diagnostics. Raises HricError if the run is not paced, that is, not held to a real-time factor."""
        self._robot_time.tick()
        self._reporter.report(self._health.report())
        self._load_reporter.report(self._load.report())

    def close(self) -> None:
        """Stop the threads."""
        self._stop.set()
        self._came.set()
        self._thread.join(1.0)
        self._load.close()
        self._robot_time.close()

    # -- frames --------------------------------------------------------------------------------------------------------

    def _on_frame(self, message: Any) -> None:
        self._health.came += 1
        self._newest.set(message)
        self._came.set()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._came.wait(WAIT)
            self._came.clear()
            if (message := self._newest.take_new()) is not None:
                self._take(message)

    def _take(self, message: Any) -> None:
        began, stamp = time.thread_time(), message.header.stamp.to_sec()
        positions = self._rows.positions(message)
        if (still := self._still) is not None and still.add(stamp, positions):
            self._still = None
            self._still_done.set()
        known = self._known.get()
        estimate = known.tracker.update(stamp, positions)
        if estimate is not None:
            self._publish(known.messages, message.header, estimate)
            self._load.add(TrackerFrame(known.live, estimate, message.header.frame_id))
        self._health.took(stamp, estimate, time.thread_time() - began)

    def _publish(self, messages: BodyMessages, head: Any, estimate: PersonEstimate) -> None:
        self._states.publish(messages.joint_states(head, estimate))
        self._tracking.publish(messages.tracking(head, estimate, self._health.dropped))
        if not 0.0 < self._next_tf - estimate.time <= 1.0 / TF_RATE:
            self._next_tf = estimate.time + 1.0 / TF_RATE
            self._tf.publish(messages.frames(head, estimate))

    # -- calibration ---------------------------------------------------------------------------------------------------

    def _on_calibrate(self, _: Any) -> Any:
        if not self._calibrating.acquire(blocking=False):
            return TriggerResponse(False, "a calibration is already running")
        try:
            return TriggerResponse(True, self._calibrate())
        except HricError as error:
            return TriggerResponse(False, str(error))
        finally:
            self._still = None
            self._calibrating.release()

    def _calibrate(self) -> str:
        settings = self._settings
        fitted = calibrate(settings.person, self._names, self._still_positions(), settings.pose)
        saved = ""
        if settings.calibration:
            fitted.save(settings.path)
            saved = f"; saved to {settings.path}"
        self._known.set(_Known.of(fitted.body, True, settings))
        self._node.set_param(f"{self._node.beside(f'hric/{PERSON}')}/robot_description", fitted.body.urdf)
        self._health.calibrated = True
        return f"calibrated: markers differ from the fitted body by {1e3 * fitted.residual:.1f} mm (rms){saved}"

    def _still_positions(self) -> FloatArray:
        """Return the mean positions of the markers while the person is still, shape (m, 3) [m]."""
        still = StillPose(self._names)
        self._still_done.clear()
        self._still, came = still, -1
        while not self._still_done.wait(PATIENCE):
            if self._health.came == came or self._stop.is_set():
                topic = self._node.resolve(self._node.beside(FRAMES))
                raise CommandError(f"no mocap frames on {topic} for {PATIENCE:g} s")
            came = self._health.came
        return still.mean()


class _Tally:
    """Counts for the diagnostics; written by one thread each, read by another.

    Attributes:
        came: number of mocap frames received.
        dropped: number of frames replaced by a newer one before they were processed.
        calibrated: True if the body was fitted to the person.
    """

    def __init__(self, calibrated: bool) -> None:
        self.came, self.dropped, self.calibrated = 0, 0, calibrated
        self._used, self._before, self._made = 0, 0, time.monotonic()
        self._last: PersonEstimate | None = None
        self._cost = 0.0

    def took(self, stamp: float, estimate: PersonEstimate | None, cost: float) -> None:
        """Count a processed mocap frame; cost: its processor time [s]."""
        self._used += 1
        self.dropped = max(self.dropped, self.came - self._used)
        self._last = estimate
        self._cost += 0.05 * (cost - self._cost)

    def report(self) -> StreamReport:
        """Return the health report for diagnostics; to be called once a second."""
        estimate, fresh, self._before = self._last, self._used - self._before, self._used
        values = {
            "frames": str(self.came),
            "frames dropped": str(self.dropped),
            "rate [Hz]": str(fresh),
            "processor time per frame [ms]": f"{1e3 * self._cost:.2f}",
            "calibrated": str(self.calibrated).lower(),
        }
        if not fresh:
            starts = not self.came and time.monotonic() - self._made < START
            return StreamReport(WARN if starts else ERROR, f"no mocap frames on {FRAMES}", values)
        if estimate is None:
            return StreamReport(
                WARN, "the person is not found: too few markers of the trunk, or they do not fit the body", values
            )
        values |= {"residual [mm]": f"{1e3 * estimate.residual:.1f}", "markers missing": ", ".join(estimate.missing)}
        if estimate.root_state == LOST or LOST in estimate.states:
            return StreamReport(WARN, f"body parts are lost; missing markers: {', '.join(estimate.missing)}", values)
        if not self.calibrated:
            return StreamReport(WARN, "tracked; the body is not calibrated to the person", values)
        return StreamReport(OK, "tracked", values)
