"""Conversion of the supervisor's decisions to ROS messages."""

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from hric_core.robot_time import stamps
from hric_msgs.msg import SafetyEvent, SafetyState, SpeedScale
from hric_supervisor.decision import FREE, STOPPED, WORLD, Decision, DecisionEvent, NearestPart
from hric_supervisor.settings import SupervisorSettings

_COLOURS = {FREE: (0.2, 0.7, 0.3), STOPPED: (0.8, 0.2, 0.2)}
_SLOWED = (0.9, 0.6, 0.1)
_VALUES = (
    "person_term",
    "reaction_term",
    "stopping_term",
    "intrusion",
    "person_uncertainty",
    "robot_uncertainty",
    "protective",
    "robot_speed",
    "person_speed",
)
"""Fields of SafetyState about the body part with the smallest margin; they are NaN without one."""


def state(decision: Decision, settings: SupervisorSettings, latency: float) -> Any:
    """Return a hric_msgs/SafetyState with a decision; latency: last measured latency of a slow-down [s]."""
    message = SafetyState(
        mode=settings.mode,
        state=decision.state,
        fault=decision.fault,
        reason=decision.reason,
        scale=decision.scale,
        stiffness=decision.stiffness,
        force=decision.force,
        separation=decision.separation,
        margin=decision.margin,
        violation=decision.violation,
        contact_speed=decision.contact_speed,
        latency=latency,
        **(dict.fromkeys(_VALUES, math.nan) if decision.part is None else _of_part(decision.part)),
    )
    message.header.stamp, message.header.frame_id = stamps.to_time(decision.time), WORLD
    if math.isfinite(decision.perception) and decision.perception >= 0.0:
        message.perception = stamps.to_time(decision.perception)
    return message


def _of_part(part: NearestPart) -> dict[str, object]:
    """Return the fields of SafetyState about the body part with the smallest margin."""
    numbers = (*part.terms, float(part.terms.total), part.robot_speed, part.person_speed)
    points = {"robot_point": Point(*part.robot_point), "person_point": Point(*part.person_point)}
    names = {"robot_link": part.robot_link, "person_link": part.person_link, "region": part.region}
    return dict(zip(_VALUES, numbers, strict=True)) | points | names


def event(decision: Decision, item: DecisionEvent) -> Any:
    """Return a hric_msgs/SafetyEvent with an event of a decision."""
    message = SafetyEvent(kind=item.kind, separation=decision.separation, margin=decision.margin, text=item.text)
    message.header.stamp = stamps.to_time(decision.time)
    return message


def request(decision: Decision, valid_for: float) -> Any:
    """Return a hric_msgs/SpeedScale request; its stamp is that of the measurement on which the decision is based.

    valid_for: time after which the robot stops without a newer request [s].
    """
    limits = {"scale": decision.scale, "stiffness": decision.stiffness, "force": decision.force}
    message = SpeedScale(valid_for=valid_for, **limits)
    message.header.stamp = stamps.to_time(decision.time if decision.fault else max(decision.perception, 0.0))
    return message


def markers(decision: Decision) -> Any:
    """Return a visualization_msgs/MarkerArray: a line between the nearest points, and a text (distance and scale)."""
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
