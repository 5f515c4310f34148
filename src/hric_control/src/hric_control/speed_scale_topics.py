"""Topics of a robot's speed scale: it subscribes to requests and publishes the state."""

import math
from collections.abc import Callable
from typing import Any

from hric_control.speed_scale import OTHERS, ScaleRequest, SpeedScale
from hric_core import realtime
from hric_core.node import Node, publisher_of
from hric_core.robot_time import stamps
from hric_msgs.msg import SpeedScale as SpeedScaleMessage
from hric_msgs.msg import SpeedScaleState

REQUEST_TOPIC, STATE_TOPIC = "hric/safety/speed_scale", "hric/safety/speed_scale_state"


class SpeedScaleTopics:
    """Subscriber to requests and publisher of the state of one robot's speed scale.

    Args:
        node: node of the robot's namespace.
        scale: speed scale of the robot.
        stamp: function that converts robot time [s] to a message stamp.
    """

    def __init__(self, node: Node, scale: SpeedScale, stamp: Callable[[float], Any]) -> None:
        self._node, self._scale, self._stamp = node, scale, stamp
        self._request: realtime.LatestValue[Any] = realtime.LatestValue(stamps.to_time(0.0))
        self._state = realtime.publisher(node, STATE_TOPIC, SpeedScaleState)
        node.subscribe(REQUEST_TOPIC, SpeedScaleMessage, self._on_request, queue_size=1)

    def _on_request(self, message: Any) -> None:
        """Apply a request; an invalid one is refused, and the publisher's last one remains until it expires."""
        request = ScaleRequest(message.scale, message.stiffness, message.force, message.valid_for or math.inf)
        self._scale.request(request, publisher_of(message) or OTHERS)
        self._request.set(message.header.stamp)

    def advance(self, time: float, period: float) -> None:
        """Advance the speed scale by one control cycle; publish its state after a request or the loss of a holder.

        To be called in the loop while the scale is active. `time`: robot time [s], `period`: that of the cycle [s]."""
        scale = self._scale
        lost = scale.lost
        scale.advance(time, period)
        if scale.lost and scale.lost != lost:
            text = (
                f"no request on {REQUEST_TOPIC} in time from {', '.join(scale.lost)}: the robot stops; it continues "
                "after a new request from the same node"
            )
            realtime.defer(self._node, lambda: self._node.log_warn(text), "log")
        if self._request.take_new() is not None or scale.lost != lost:
            now = scale.target, scale.value, scale.stiffness, scale.force, scale.expired, scale.holder
            self._state.publish(_state, self._stamp(time), self._request.get(), *now)


def _state(
    stamp: Any, request: Any, requested: float, scale: float, stiffness: float, force: float, expired: bool, holder: str
) -> Any:
    message = SpeedScaleState(request=request, requested=requested, scale=scale, expired=expired, holder=holder)
    message.header.stamp, message.stiffness, message.force = stamp, stiffness, force
    return message
