"""Figures of the simulated human: grips, contacts, carried objects, muscles and joints."""

from collections.abc import Sequence

import numpy as np

from hric_analysis.carrying import Transport
from hric_assessment.contact.impact import Clamping, ClosedFormImpact, ExpectedContact
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.muscle_record import MuscleRecord
from hric_human.muscles.lines import ACTIVATION_COLOURS
from hric_report.figure import Curve, Figure, Panel, path, per_joint
from hric_report.figures import FigureData
from hric_report.heat import heat_map
from hric_report.sections import HUMAN

SHOWN = 1.5
"""Time span of an impact that is shown, as multiple of the duration of the expected half sine [1]."""
ESTIMATE = "Estimate of a model, not a measurement of a person."


def figures(data: FigureData) -> list[Figure]:
    """Return the figures of the simulated human of a run; none if the run has no human."""
    person = data.person
    if person is None:
        return []
    record = person.record
    made = []
    if panels := [_grip_panel(name, record) for name, grip in record.grips.items() if grip.closed.any()]:
        forces = Figure("grip", "Grip force", "force on the hand [N]", tuple(panels), min_height=1.0)
        made.append(forces.about(HUMAN, f"Force of the held object on the hand that holds it. {ESTIMATE}"))
    made += _contact_figures(person.impacts)
    for k, transport in enumerate(person.transports):
        suffix = f"_{k + 1}" if len(person.transports) > 1 else ""
        made += [_carrying(transport, f"carrying{suffix}"), _path(transport, f"carrying_path{suffix}")]
    if record.muscles is not None:
        made += _muscle_figures(record.muscles)
    share = Curve("of the strength", "measured", record.torque_time, record.share)
    strength = per_joint(
        "strength",
        "Joint torques of the human as share of the strength",
        "share [1]",
        record.joints,
        [share],
        lambda joint: (("strength", 1.0),),
        min_height=0.1,
    )
    angles = per_joint(
        "human_joints",
        "Joints of the human",
        "angle [rad]",
        record.joints,
        [Curve("angle", "measured", record.time, record.position)],
        min_height=0.02,
    )
    return [
        *made,
        strength.about(
            HUMAN, f"Joint torque divided by the strength in the direction in which the torque acts. {ESTIMATE}"
        ),
        angles.about(HUMAN, "Joint angles of the simulated body."),
    ]


def _muscle_figures(record: MuscleRecord) -> list[Figure]:
    """Return the heat map of muscle activation and the contact forces between bones."""
    sides = {name.partition("_")[0] for name in record.names}
    rows = tuple(name.partition("_")[2] if len(sides) == 1 else name for name in record.names)
    heat = heat_map(rows, record.time, record.activation, "activation [1]", ACTIVATION_COLOURS)
    caption = (
        f"Activation of {len(record.muscles)} muscles, and of the ideal actuators of joints without muscles, whose "
        "names "
        f"end with their direction. All values above {heat.top:g} have the same colour. {ESTIMATE}"
    )
    made = [Figure("activation", "Activation of the muscles", "", (Panel("", (), heat=heat),)).about(HUMAN, caption)]
    if record.contact:
        panels = tuple(
            Panel(joint, (Curve("contact force", "measured", record.contact_time, size),))
            for joint, size in record.contact.items()
        )
        figure = Figure("joint_contact", "Contact forces between bones", "force [N]", panels, min_height=10.0)
        text = f"Force of the proximal on the distal bone of a joint, including the pull of the muscles. {ESTIMATE}"
        made.append(figure.about(HUMAN, text))
    return made


def _contact_figures(impacts: Sequence[ExpectedContact]) -> list[Figure]:
    """Return the figures of impacts and of clamping, for spring contacts with an expected (closed-form) force."""
    strongest: dict[tuple[str, str], tuple[ExpectedContact, ClosedFormImpact]] = {}
    for impact in impacts:
        pair, form = (impact.contact.link, impact.contact.other), impact.impact
        if (
            form is not None
            and len(impact.contact.series.time)
            and (pair not in strongest or form.peak > strongest[pair][1].peak)
        ):
            strongest[pair] = impact, form
    made = []
    if panels := [_blow_panel(*impact_and_form) for impact_and_form in strongest.values()]:
        text = (
            "Force on the human from the first touch on, for the strongest impact of each pair of bodies; for "
            "comparison the "
            "half sine of two reflected masses with the spring of the body region, aligned with the first recorded "
            "force. "
            f"{ESTIMATE}"
        )
        figure = Figure(
            "blow", "Impact", "force [N]", tuple(panels), min_height=1.0, abscissa="after the first touch [ms]"
        )
        made.append(figure.about(HUMAN, text))
    if panels := [_press_panel(impact, impact.clamping) for impact in impacts if impact.clamping]:
        text = (
            f"Force of lasting contacts, and the force along the normal that the commanded torque balances. {ESTIMATE}"
        )
        figure = Figure("press", "Clamping", "force [N]", tuple(panels), min_height=1.0)
        made.append(figure.about(HUMAN, text))
    return made


def _blow_panel(impact: ExpectedContact, form: ClosedFormImpact) -> Panel:
    series, begin = impact.contact.series, impact.contact.begin
    shown = series.time <= begin + SHOWN * form.duration
    time, force = series.time[shown] - series.time[0] + impact.late(), series.force[shown]
    instants = np.linspace(0.0, form.duration, 101)
    curves = (
        Curve("half sine", "desired", 1e3 * instants, form.force(instants)),
        Curve("simulated", "measured", 1e3 * time, force),
    )
    return Panel(f"{_between(impact)}, {form.speed:.2f} m/s", curves, (("v sqrt(mu k)", form.peak),))


def _press_panel(impact: ExpectedContact, press: Clamping) -> Panel:
    curves = (
        Curve("balanced by the commanded torque", "desired", press.time, press.balanced),
        Curve("contact", "measured", press.time, press.force),
    )
    _, _, level = press.level()
    return Panel(_between(impact), curves, (("balanced", level),))


def _between(impact: ExpectedContact) -> str:
    return f"{', '.join(impact.contact.regions) or impact.contact.link}: {impact.contact.other}"


def _carrying(transport: Transport, key: str) -> Figure:
    """Return the figure of load share, internal force and tilt of a carried object over time."""
    panels = []
    if transport.share is not None:
        shares = zip(transport.ends, transport.share, strict=True)
        curves = tuple(Curve(name, f"s{k}", transport.time, 100.0 * share) for k, (name, share) in enumerate(shares))
        panels.append(Panel("load share", curves, unit="of the weight [%]"))
    panels += [
        Panel("internal force", (Curve("both together", "s2", transport.time, transport.squeeze),), unit="force [N]"),
        Panel("tilt", (Curve("both together", "s2", transport.time, np.rad2deg(transport.tilt)),), unit="angle [deg]"),
    ]
    a, b = transport.ends
    caption = (
        f"Vertical force of the grips {a} and {b} on {transport.body} as share of its weight; internal force, the "
        "part of "
        "both grip forces that cancels along the line between the grips (positive: squeezed, negative: stretched); "
        f"inclination of this line (positive: {b} is higher). {ESTIMATE}"
    )
    return Figure(key, f"{transport.body}, carried by two", "", tuple(panels), min_height=1.0, columns=3).about(
        HUMAN, caption
    )


def _path(transport: Transport, key: str) -> Figure:
    """Return the figure of the paths of an object's ends and midpoint, each relative to its start."""
    points = [
        *zip(transport.ends, ("s0", "s1"), transport.point, strict=True),
        ("middle of both", "s2", transport.centre),
    ]
    curves = [Curve(name, role, transport.time, point - point[0]) for name, role, point in points]
    caption = (
        f"Displacement of both ends of {transport.body} and of their midpoint from the start, seen along each axis."
    )
    figure = path(key, f"Path of {transport.body}", curves, ("from above", "from the side", "along x"))
    return figure.about(HUMAN, caption)


def _grip_panel(name: str, record: HumanRecord) -> Panel:
    grip = record.grips[name]
    force = np.where(grip.closed[:, None], grip.force, np.nan)
    size = np.linalg.norm(force, axis=1)
    axes = [Curve(axis, f"s{i}", grip.time, force[:, i]) for i, axis in enumerate("xyz")]
    return Panel(f"{name}: {grip.held}", (*axes, Curve("size", "s3", grip.time, size)))
