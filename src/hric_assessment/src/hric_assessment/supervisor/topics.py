"""Messages of the supervisor, made from its decisions."""

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from hric_assessment.supervisor.decision import FREE, STOPPED, WORLD, Decision, Event
from hric_assessment.supervisor.settings import SupervisorSettings
from hric_core.robot_time import stamps
from hric_msgs.msg import SafetyEvent, SafetyState, SpeedScale

_COLOURS = {FREE: (0.2, 0.7, 0.3), STOPPED: (0.8, 0.2, 0.2)}
_SLOWED = (0.9, 0.6, 0.1)
_TERMS = ("person", "reaction", "stopping", "intrusion", "person_uncertainty", "robot_uncertainty")


def state(decision: Decision, settings: SupervisorSettings, latency: float) -> Any:
    """Return a hric_msgs/SafetyState; latency: the last one [s]."""
    message = SafetyState(mode=settings.mode, state=decision.state, fault=decision.fault, reason=decision.reason)
    message.header.stamp, message.header.frame_id = stamps.to_time(decision.time), WORLD
    message.scale, message.stiffness, message.force = decision.scale, decision.stiffness, decision.force
    message.separation, message.margin, message.violation = decision.separation, decision.margin, decision.violation
    message.contact_speed, message.latency = decision.contact_speed, latency
    if math.isfinite(decision.perception) and decision.perception >= 0.0:
        message.perception = stamps.to_time(decision.perception)
    part = decision.part
    names = [f"{name}_term" if name in _TERMS[:3] else name for name in _TERMS]
    for at, name in enumerate(names):
        setattr(message, name, math.nan if part is None else part.terms[at])
    message.protective = math.nan if part is None else float(part.terms.total)
    message.robot_speed = math.nan if part is None else part.robot_speed
    message.person_speed = math.nan if part is None else part.person_speed
    if part is not None:
        message.robot_link, message.person_link, message.region = part.robot_link, part.person_link, part.region
        message.robot_point, message.person_point = Point(*part.robot_point), Point(*part.person_point)
    return message


def event(decision: Decision, one: Event) -> Any:
    """Return a hric_msgs/SafetyEvent."""
    message = SafetyEvent(kind=one.kind, separation=decision.separation, margin=decision.margin, text=one.text)
    message.header.stamp = stamps.to_time(decision.time)
    return message


def request(decision: Decision, valid_for: float) -> Any:
    """Return a hric_msgs/SpeedScale, stamped with the measurement that it follows from."""
    message = SpeedScale()
    message.scale, message.stiffness, message.force = decision.scale, decision.stiffness, decision.force
    message.valid_for = valid_for
    message.header.stamp = stamps.to_time(decision.time if decision.fault else max(decision.perception, 0.0))
    return message


def markers(decision: Decision) -> Any:
    """Return a visualization_msgs/MarkerArray: a line between the nearest points, and a text."""
    colour = _COLOURS.get(decision.state, _SLOWED)
    line, text = _marker(0, Marker.LINE_STRIP, colour, decision.time), _marker(1, Marker.TEXT_VIEW_FACING, colour, 0.0)
    text.header = line.header
    part = decision.part
    text.text = decision.fault or f"{decision.separation:.2f} m, {100.0 * decision.scale:.0f} %"
    line.scale.x, text.scale.z = 0.01, 0.06
    text.pose.position.z = 1.2
    if part is None:
        line.action = Marker.DELETE
    else:
        line.points = [Point(*part.robot_point), Point(*part.person_point)]
        middle = [0.5 * (a + b) for a, b in zip(part.robot_point, part.person_point, strict=True)]
        text.pose.position = Point(*middle)
    return MarkerArray(markers=[line, text])


def _marker(number: int, kind: int, colour: Sequence[float], time: float) -> Any:
    message = Marker(ns="supervisor", id=number, type=kind)
    message.header.frame_id, message.header.stamp = WORLD, stamps.to_time(time)
    message.pose.orientation.w = 1.0
    message.color.r, message.color.g, message.color.b = colour
    message.color.a = 1.0
    return message
