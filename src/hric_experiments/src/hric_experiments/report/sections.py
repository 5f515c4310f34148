"""The parts of a report by what they are about, in the order in which they are read."""

FOUND = "What was found"
MOTION = "Motion"
FORCES = "Forces and torques"
TRACKING = "Motion capture and tracking"
EMG = "EMG"
PLATE = "Force plate"
SYNC = "Synchronisation"
LIMITS = "Limits and stability"
OTHER = "Other measurements"
MADE = "How it was made"
ORDER = (FOUND, MOTION, FORCES, TRACKING, EMG, PLATE, SYNC, LIMITS, OTHER, MADE)
