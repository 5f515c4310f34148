"""Connection to a UR controller through ur_rtde: states, servo commands, and errors of arm and connection."""

import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from hric_control.limits import ENFORCE_LIMITS
from hric_core.errors import FailureError
from hric_core.parameters import Settings, flag, number, text, whole

PORT = 30004
"""TCP port of RTDE, fixed in the controller."""
HELLO = struct.pack(">HBH", 5, ord("V"), 2)
"""RTDE package that requests protocol version 2."""
WATCHDOG_RATE = 2.0
"""Rate of commands below which the controller ends the control program [Hz]; project default, unconfirmed."""
PLAYING = 2
"""Value of ur_rtde's runtime state while the control program runs."""
START_TIMEOUT = 5.0
"""Time that the control program may take to start [s], as in ur_rtde."""
POLL = 0.0002
"""Period of polling for a new state [s]."""
SAFETY = {
    2: "protective stop",
    3: "recovery mode",
    4: "safeguard stop",
    5: "emergency stop of the system",
    6: "emergency stop of the robot",
    7: "emergency stop",
    8: "safety violation",
    9: "fault of the safety system",
    10: "stopped for safety",
}
"""Reasons why the arm executes no command, by bit of `safety_status_bits` (RTDE guide of the manufacturer)."""


ROBOT_IP: Any = text(
    valid="an address, e.g. 192.168.56.101,", empty=False, name="robot_ip", text="address of the controller"
)


@dataclass(frozen=True)
class UrSettings(Settings):
    """Parameters of the robot node for an arm of Universal Robots.

    Defaults of `lookahead_time` and `gain` are those of ur_rtde's examples; the others are project defaults,
    unconfirmed.
    """

    robot_ip: str = ROBOT_IP
    lookahead_time: float = number(
        0.1,
        minimum=0.03,
        maximum=0.2,
        unit="s",
        text="lookahead time of `servoj`: a larger value smooths and delays more",
    )
    gain: float = number(300.0, minimum=100.0, maximum=2000.0, text="proportional gain of `servoj`")
    lost_after: float = number(
        0.5, above=0.0, maximum=1.0, unit="s", text="time without a new state after which the connection is lost"
    )
    probe_timeout: float = number(
        1.0, above=0.0, unit="s", text="time limit for the first connection to the controller"
    )
    enforce_limits: tuple[str, ...] = ENFORCE_LIMITS
    realtime_priority: int = whole(80, minimum=0, maximum=98, text="SCHED_FIFO priority of the loop; 0: none")
    lock_memory: bool = flag(True, text="keep the process from being paged out")
    switch_interval: float = number(0.0005, above=0.0, unit="s", text="thread switch interval of Python")


class UrLostError(FailureError):
    """Error of a controller that does not respond, or has stopped responding."""


class UrStoppedError(FailureError):
    """Error of an arm that has stopped, or whose control program has ended."""


def probe(address: str, timeout: float) -> None:
    """Check that the controller responds to RTDE; ur_rtde itself would block all Python threads without a time limit.

    Args:
        address: address of the controller.
        timeout: time limit [s].

    Raises:
        UrLostError: no controller responds.
    """
    try:
        with socket.create_connection((address, PORT), timeout) as connection:
            connection.sendall(HELLO)
            if connection.recv(4)[:3] == struct.pack(">HB", 4, ord("V")):
                return
            reason = "the program there does not speak RTDE protocol version 2"
    except OSError as error:
        reason = str(error.strerror or error)
    raise UrLostError(
        f"no UR controller at {address}: TCP port {PORT}: {reason}. Check robot_ip, and switch the controller on; for "
        f"an emulated one, start: hric ur_controller --ip {address}"
    )


class UrConnection:
    """Connection to an arm through ur_rtde, which uploads its control program.

    Args:
        settings: parameters of the robot node.

    Raises:
        UrLostError: no controller responds, or ur_rtde cannot connect.
        FailureError: ur_rtde is not installed.
    """

    def __init__(self, settings: UrSettings) -> None:
        self._settings, self._time, self._failed = settings, -1.0, False
        probe(settings.robot_ip, settings.probe_timeout)
        try:
            from rtde_control import RTDEControlInterface
            from rtde_receive import RTDEReceiveInterface
        except ImportError as error:
            raise FailureError(
                "an arm of Universal Robots needs ur_rtde, which is not installed; run scripts/setup --with ur"
            ) from error
        names = ["timestamp", "actual_q", "actual_qd", "target_q", "safety_status_bits", "runtime_state"]
        try:
            self._states: Any = RTDEReceiveInterface(settings.robot_ip, variables=names)
            self._refuse_stopped()
            self._control: Any = RTDEControlInterface(settings.robot_ip)
        except RuntimeError as error:
            raise UrLostError(
                f"ur_rtde cannot use the UR controller at {settings.robot_ip}: {error}. Enable remote control on the "
                "teach pendant, and free the input registers 0 to 23 of fieldbuses"
            ) from error

    def start(self) -> None:
        """Start the control program, unless it runs already, and its watchdog. Raises UrLostError or UrStoppedError.

        From now on, `servo` or `keep` must be called after each state: otherwise the watchdog ends the program.
        """
        for _ in range(2):  # the first may have arrived long ago
            self._next()
        deadline = time.monotonic() + START_TIMEOUT
        if self._states.getRuntimeState() != PLAYING:
            self._control.reuploadScript()
        while self._states.getRuntimeState() != PLAYING:
            if time.monotonic() > deadline:
                raise UrStoppedError("ur_rtde's control program does not start: see the log of the controller")
            time.sleep(POLL)
        self._within(lambda: self._obey(lambda: self._control.setWatchdog(WATCHDOG_RATE)))

    def _within(self, call: Callable[[], object]) -> None:
        """Make a call that ur_rtde may block for 5 minutes; raise its error, or UrLostError after `START_TIMEOUT`."""
        outcome: list[Exception | None] = []

        def work() -> None:
            try:
                call()
                outcome.append(None)
            except Exception as error:  # raised again below
                outcome.append(error)

        thread = threading.Thread(target=work, name="ur_rtde", daemon=True)
        thread.start()
        thread.join(START_TIMEOUT)
        failure = outcome[0] if outcome else self._lost("no response", START_TIMEOUT)
        if failure is not None:
            raise failure

    def wait(self) -> float:
        """Wait for a new state and return its time [s]. Raises UrLostError or UrStoppedError."""
        stamp = self._next()
        if self._states.getRuntimeState() != PLAYING:
            raise UrStoppedError("ur_rtde's control program has ended: see the log of the controller")
        return stamp

    def _next(self) -> float:
        deadline = time.monotonic() + self._settings.lost_after
        while (stamp := float(self._states.getTimestamp())) == self._time:
            if time.monotonic() > deadline or not self._states.isConnected():
                raise self._lost("no new state", self._settings.lost_after)
            time.sleep(POLL)
        self._time = stamp
        self._refuse_stopped()
        return stamp

    def _lost(self, what: str, duration: float | None = None) -> UrLostError:
        self._failed = True
        since = "" if duration is None else f" for {duration:g} s"
        return UrLostError(
            f"the connection to the UR controller at {self._settings.robot_ip} is lost: {what}{since}. Check the "
            "network and the controller, and start again"
        )

    def _refuse_stopped(self) -> None:
        bits = int(self._states.getSafetyStatusBits())
        reasons = [text for bit, text in SAFETY.items() if bits >> bit & 1]
        if reasons:
            self._failed = True
            raise UrStoppedError(
                f"the arm reports: {', '.join(reasons)}. Find the cause, release it on the teach pendant, "
                "and start again"
            )

    def read(self, position: list[float], velocity: list[float]) -> None:
        """Write the joint positions [rad] and velocities [rad/s] of the present state into the lists."""
        position[:], velocity[:] = self._states.getActualQ(), self._states.getActualQd()

    def target(self) -> list[float]:
        """Return the position that the controller holds or follows, 6 floats [rad]."""
        return list(self._states.getTargetQ())

    def keep(self) -> None:
        """Reset the controller's watchdog without commanding a motion."""
        self._obey(lambda: self._control.kickWatchdog())

    def servo(self, q: Sequence[float], period: float) -> None:
        """Command a joint position, 6 floats [rad], to be reached within `period` [s]."""
        settings = self._settings
        self._obey(lambda: self._control.servoJ(list(q), 0.0, 0.0, period, settings.lookahead_time, settings.gain))

    def _obey(self, call: Callable[[], bool]) -> None:
        # ur_rtde would reconnect by itself, and move the arm on.
        if not self._control.isConnected():
            raise self._lost("no command accepted")
        try:
            if call():
                return
        except RuntimeError as error:
            raise self._lost(f"no command accepted ({error})") from error
        self._refuse_stopped()
        raise UrStoppedError(
            "ur_rtde's control program has ended, so a command was refused: see the log of the controller"
        )

    def close(self) -> None:
        """End the control program, unless the arm or the connection has failed, and disconnect."""
        if not self._failed and self._control.isConnected():
            with suppress(UrLostError):  # then the controller's watchdog has ended it
                self._within(self._control.stopScript)
        self._control.disconnect()
        self._states.disconnect()
