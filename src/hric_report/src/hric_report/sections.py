"""Sections of a report in reading order, and the assignment of topics to them."""

import re

VERDICT = "What it would have meant"
RESULTS = "What was found"
MOTION = "Motion"
FORCES = "Forces and torques"
HUMAN = "The human"
SUPERVISOR = "The supervisor"
TRACKING = "Motion capture and tracking"
EMG = "EMG"
PLATE = "Force plate"
SYNC = "Synchronisation"
LIMITS = "Limits and stability"
OTHER = "Other measurements"
MADE = "How it was made"
ORDER = (VERDICT, RESULTS, MOTION, FORCES, HUMAN, SUPERVISOR, TRACKING, EMG, PLATE, SYNC, LIMITS, OTHER, MADE)
KNOWN = (
    (r"/emg/raw$", EMG, "Muscle activity", "EMG as the device sent it, one panel per muscle."),
    (r"/emg/envelope$", EMG, "Envelope of the muscle activity", "Rectified and low-pass filtered EMG."),
    (r"/view/emg$", EMG, "Envelope of the muscle activity, as viewed", "The envelope that a viewer got."),
    (
        r"/force_plate/([^/]+)/wrench$",
        PLATE,
        r"Load on force plate \1",
        "Force and moment about the middle of the surface, mean of each message.",
    ),
    (
        r"/force_plate/([^/]+)/samples$",
        PLATE,
        r"Samples of force plate \1",
        "Channels of the plate as the device sent them.",
    ),
    (
        r"/force_plate/([^/]+)/cop$",
        PLATE,
        r"Centre of pressure on force plate \1",
        "From the middle of the surface, while the vertical force is above 20 N.",
    ),
    (
        r"/F_ext$",
        FORCES,
        "External wrench on the end effector",
        "Estimated by the robot, in its stiffness frame.",
    ),
    (r"/arm_wrench$", FORCES, "External wrench, as viewed", "The estimate that a viewer got."),
    (
        r"/commanded_wrench$",
        FORCES,
        "Wrench of the controller's spring and damper",
        "In the axes of the robot's base.",
    ),
    (
        r"/mocap/marker_stamped$",
        TRACKING,
        "Position of the marker",
        "Position of the body that the motion capture tracked.",
    ),
)
"""Known topics: pattern of the name, section of the report, title and caption of the figure."""


def of_topic(topic: str) -> tuple[str, str, str]:
    """Return section, title and caption of a topic; an unknown topic has its name as title."""
    for pattern, section, title, caption in KNOWN:
        match = re.search(pattern, topic)
        if match:
            return section, match.expand(title), caption
    return OTHER, topic, "As it was recorded."
