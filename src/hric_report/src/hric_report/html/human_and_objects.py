"""Human and objects in the replay of a run, with grip forces, contact forces and muscles."""

from dataclasses import replace

import numpy as np

from hric_analysis.human import SimulatedPerson
from hric_bags.records.human_record import GripRecord
from hric_bags.records.muscle_record import MuscleRecord
from hric_bags.records.region_contacts import ContactRecord
from hric_core.errors import HricError
from hric_human.body import Body
from hric_human.body.segments import SIDES, link_name
from hric_human.muscles.choose import find
from hric_human.muscles.lines import ACTIVATION_COLOURS, muscle_lines
from hric_human.participant.settings import HumanSettings
from hric_report.html.body_picture import CONTACT, NOT_ASSESSABLE, region_keys, shown_share
from hric_report.html.run_data import RunData
from hric_report.html.scene import Arrow, SceneLines, SceneRobot, SceneSkin, SceneTouch, SceneTrack, instants
from hric_skin import fitted

PER_NEWTON_GRIP, PER_NEWTON_CONTACT = 0.02, 0.002
"""Arrow length per newton for grip and contact forces, as in the live view [m/N]; project defaults, unconfirmed."""


def width(data: RunData) -> int:
    """Return how many numbers the replay of the human stores per instant; 0 without a human."""
    if data.person is None:
        return 0
    record = data.person.record
    muscles = 0 if record.muscles is None else len(record.muscles.muscles) + 1
    walks = 0 if record.root is None else 8
    return walks + len(record.joints) + 1 + 7 * (len(record.grips) + len(record.contacts)) + muscles


def human(data: RunData, rate: float, *, role: str = "", shift: float = 0.0) -> list[SceneRobot]:
    """Return the human of a run as a robot of the replay; empty without a human.

    Args:
        data: run data.
        rate: maximum number of replayed instants per second [Hz].
        role: colour role of the run on a page with several runs; "": work clothes.
        shift: offset added to all times [s].
    """
    if data.person is None:
        return []
    settings = HumanSettings.of(data.run["definition"]["human"], "human")
    person = simulated_person(data.person, settings, rate, role=role, shift=shift)
    if person.skin is not None:
        person.skin = replace(person.skin, touches=_touches(data, data.person.record.name, shift))
    return [person]


def simulated_person(
    simulated: SimulatedPerson, settings: HumanSettings, rate: float, *, role: str = "", shift: float = 0.0
) -> SceneRobot:
    """Return a simulated person as a robot of the replay; see `human`.

    Args:
        simulated: recorded data of the person.
        settings: section `human` of the experiment, with body and position.
        rate: maximum number of replayed instants per second [Hz].
        role: colour role of the run in a comparison; "": the person wears the colours of work clothes.
        shift: offset added to all times [s].
    """
    record, body = simulated.record, settings.body()
    shown = instants(record.time, rate)
    arrows = [_grip(grip, rate, shift) for grip in record.grips.values()]
    arrows += [_contact(person, rate, shift) for person in record.contacts.values()]
    time, position = record.time[shown] + shift, record.position[shown]
    lines = None if record.muscles is None else _muscles(record.muscles, body, settings, rate, shift)
    person = SceneRobot(
        "", body.urdf, record.joints, time, position, role=role, pose=settings.root(body), arrows=arrows
    )
    person.lines = lines
    # A hand that holds something at any time is drawn closed all the time.
    held = {
        name.rpartition("::")[2]
        for grip in record.grips.values()
        if grip.closed.any()
        for name in (grip.holder, grip.held)
    }
    person.skin = SceneSkin.of(fitted(body, [side for side in SIDES if link_name("hand", side) in held]))
    if record.root is not None:
        seen = instants(record.root.time, rate)
        person.motion = SceneTrack("frame", "person", "world", record.root.time[seen] + shift, record.root.pose[seen])
    return person


def _touches(data: RunData, name: str, shift: float) -> list[SceneTouch]:
    """Return the contacts of a person in the run's verdict, which colour their skin.

    Args:
        data: data of the run.
        name: namespace of the person.
        shift: offset added to all times [s].
    """
    contacts = [] if data.verdict is None else data.verdict["findings"]
    return [
        SceneTouch(
            *(finding["window"][0] + shift, finding["window"][1] + shift),
            tuple(key for region in finding["regions"] for key in region_keys(region, finding["side"])),
            None if finding["outcome"] == NOT_ASSESSABLE else shown_share(finding["share"], finding["outcome"]),
        )
        for finding in contacts
        if finding["group"] == CONTACT and finding["window"] and finding["regions"]
        if finding["person"] in ("", name)
    ]


def _muscles(record: MuscleRecord, body: Body, settings: HumanSettings, rate: float, shift: float) -> SceneLines | None:
    """Return the lines of the muscles, coloured by activation; None if the run's muscle anatomy cannot be read."""
    try:
        lines = muscle_lines(body, find(settings.muscles.anatomy, "human.muscles.anatomy"))
    except HricError:
        return None
    shown, names = instants(record.time, rate), record.muscles
    activation = record.activation[shown][:, [record.names.index(name) for name in names]]
    points = {name: lines[name] for name in names}
    return SceneLines(points, record.time[shown] + shift, activation, ACTIVATION_COLOURS, "activation of the muscles")


def objects(data: RunData, *, role: str = "", shift: float = 0.0) -> list[SceneRobot]:
    """Return the objects of a run as robots of the replay; `role` and `shift` as for `human`."""
    return [
        SceneRobot(
            "",
            item.description,
            (),
            item.time[:1] + shift,
            np.zeros((1, 0)),
            role=role,
            motion=SceneTrack("frame", item.name, "world", item.time + shift, item.pose),
        )
        for item in data.objects
    ]


def _grip(grip: GripRecord, rate: float, shift: float) -> Arrow:
    shown = instants(grip.time, rate)
    force = np.where(grip.closed[shown, None], grip.force[shown], 0.0)
    name = f"force of {grip.held} on {grip.holder}"
    return Arrow(name, "measured", "world", grip.time[shown] + shift, force, grip.point[shown], PER_NEWTON_GRIP, False)


def _contact(contact: ContactRecord, rate: float, shift: float) -> Arrow:
    """Return the arrow of a contact force; it shows the peak between replayed instants, so that none is missed."""
    first = instants(contact.time, rate)
    parts = np.split(np.arange(len(contact.time)), first[1:])
    largest = [part[np.argmax(contact.force[part])] for part in parts]
    name = f"contact of {', '.join(contact.regions) or contact.link}"
    along = contact.force[largest, None] * contact.normal[largest]
    time, point = contact.time[first] + shift, contact.point[largest]
    return Arrow(name, "limit", "world", time, along, point, PER_NEWTON_CONTACT, True)
