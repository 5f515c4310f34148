"""Sections of a report in reading order, and the section, title and caption for the figure of each known topic."""

import re

VERDICT = "Safety and ergonomics"
RESULTS = "Key figures"
MOTION = "Motion"
FORCES = "Forces and torques"
HUMAN = "Simulated human"
SUPERVISOR = "Safety supervisor"
TRACKING = "Motion capture and tracking"
EMG = "EMG"
PLATE = "Force plate"
SYNC = "Synchronisation"
LIMITS = "Limits and stability"
OTHER = "Other measurements"
MADE = "Origin of the data"
ORDER = (VERDICT, RESULTS, MOTION, FORCES, HUMAN, SUPERVISOR, TRACKING, EMG, PLATE, SYNC, LIMITS, OTHER, MADE)
KNOWN = (
    (r"/emg/raw$", EMG, "Muscle activity", "Raw EMG as sent by the device, one panel per muscle."),
    (r"/emg/envelope$", EMG, "Envelope of the muscle activity", "Rectified and low-pass filtered EMG."),
    (
        r"/view/emg$",
        EMG,
        "Envelope of the muscle activity, for the live view",
        "EMG envelope as sent to the live view.",
    ),
    (
        r"/force_plate/([^/]+)/wrench$",
        PLATE,
        r"Load on force plate \1",
        "Force, and moment about the middle of the surface; mean of each message.",
    ),
    (
        r"/force_plate/([^/]+)/samples$",
        PLATE,
        r"Samples of force plate \1",
        "Channels of the force plate as sent by the device.",
    ),
    (
        r"/force_plate/([^/]+)/cop$",
        PLATE,
        r"Centre of pressure on force plate \1",
        "Position relative to the middle of the surface, while the vertical force is above 20 N.",
    ),
    (
        r"/F_ext$",
        FORCES,
        "External wrench on the end effector",
        "Estimated by the robot, in its stiffness frame.",
    ),
    (
        r"/arm_wrench$",
        FORCES,
        "External wrench, for the live view",
        "Estimated external wrench as sent to the live view.",
    ),
    (
        r"/commanded_wrench$",
        FORCES,
        "Commanded wrench",
        "Wrench of the controller's spring and damper, in the axes of the robot's base.",
    ),
    (
        r"/mocap/marker_stamped$",
        TRACKING,
        "Position of the marker",
        "Position of the rigid body that the motion capture system tracked.",
    ),
)
"""Known topics: pattern of the name, section of the report, title and caption of the figure."""


def of_topic(topic: str) -> tuple[str, str, str]:
    """Return section, title and caption for the figure of a topic; an unknown topic has its name as title."""
    for pattern, section, title, caption in KNOWN:
        match = re.search(pattern, topic)
        if match:
            return section, match.expand(title), caption
    return OTHER, topic, "Values as recorded."
