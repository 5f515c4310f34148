"""Masses, lengths and inertias of body segments: the table of de Leva 1996, scaled to a subject.

Source: de Leva, Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters, J. Biomech. 29(9):1223-1230, 1996,
table 4: 100 men (73.0 kg, 1.741 m) and 15 women (61.9 kg, 1.735 m). The paper was not opened; the values come from
public transcriptions that were compared value by value:

- masses, centres of mass and radii of gyration: BMClab/BMC (data/BSPmale_ZdeLeva.txt, BSPfemale_ZdeLeva.txt) and
  deleva.m of R. Gurchiek (2018), equal in all of them; those of the limbs also in a DeLevaTable of biorbd's family,
  except for its 0.0669 (mass of a female head) and 0.124 (radius of a female foot), which occur nowhere else;
- lengths: deleva.m; of head, trunk, upper arm, forearm, thigh and shank also HumanBodyParam.cpp (of an exoskeleton, as
  shares of the height); of the male leg and foot also param_init.m of RiccardoFrenner/human_ski_model. The lengths of
  the hand to the finger tip, of the upper trunk and to the mid-shoulder follow from the confirmed ones, since the table
  has two descriptions of each whose centres of mass must agree; the three parts of the trunk add up to the trunk.

Unconfirmed by a second source: the length of the female foot, and the border of middle and lower trunk.
"""

from dataclasses import dataclass

MEAN_HEIGHT = {"female": 1.735, "male": 1.741}
"""Mean height of the people measured for de Leva's table, by sex [m]; segment lengths scale with the height."""


@dataclass(frozen=True)
class SegmentRow:
    """Row of de Leva's table: mass, length, centre of mass and radii of gyration of one body segment.

    Attributes:
        mass: share of the total body mass [1].
        length: length in the mean body [m].
        com: distance of the centre of mass from the first end point, as share of the length [1].
        radii: radii of gyration about the sagittal (forward), transverse (sideward) and longitudinal axis through the
            centre of mass, as shares of the length [1].
    """

    mass: float
    length: float
    com: float
    radii: tuple[float, float, float]


ENDS = {
    "head": ("vertex", "cervicale"),
    "upper_trunk": ("cervicale", "xiphion"),
    "middle_trunk": ("xiphion", "omphalion"),
    "lower_trunk": ("omphalion", "middle of the hip joint centres"),
    "upper_arm": ("shoulder joint centre", "elbow joint centre"),
    "forearm": ("elbow joint centre", "wrist joint centre"),
    "hand": ("wrist joint centre", "tip of the third finger"),
    "thigh": ("hip joint centre", "knee joint centre"),
    "shank": ("knee joint centre", "ankle joint centre"),
    "foot": ("heel", "tip of the longest toe"),
}
"""First and second end point of each segment in de Leva's table."""

DE_LEVA = {
    "female": {
        "head": SegmentRow(0.0668, 0.2437, 0.4841, (0.271, 0.295, 0.261)),
        "upper_trunk": SegmentRow(0.1545, 0.2280, 0.5050, (0.466, 0.314, 0.449)),
        "middle_trunk": SegmentRow(0.1465, 0.2053, 0.4512, (0.433, 0.354, 0.415)),
        "lower_trunk": SegmentRow(0.1247, 0.1815, 0.4920, (0.433, 0.402, 0.444)),
        "upper_arm": SegmentRow(0.0255, 0.2751, 0.5754, (0.278, 0.260, 0.148)),
        "forearm": SegmentRow(0.0138, 0.2643, 0.4559, (0.261, 0.257, 0.094)),
        "hand": SegmentRow(0.0056, 0.1701, 0.3427, (0.244, 0.208, 0.154)),
        "thigh": SegmentRow(0.1478, 0.3685, 0.3612, (0.369, 0.364, 0.162)),
        "shank": SegmentRow(0.0481, 0.4386, 0.4352, (0.267, 0.263, 0.092)),
        "foot": SegmentRow(0.0129, 0.2283, 0.4014, (0.299, 0.279, 0.139)),
    },
    "male": {
        "head": SegmentRow(0.0694, 0.2429, 0.5002, (0.303, 0.315, 0.261)),
        "upper_trunk": SegmentRow(0.1596, 0.2421, 0.5066, (0.505, 0.320, 0.465)),
        "middle_trunk": SegmentRow(0.1633, 0.2155, 0.4502, (0.482, 0.383, 0.468)),
        "lower_trunk": SegmentRow(0.1117, 0.1457, 0.6115, (0.615, 0.551, 0.587)),
        "upper_arm": SegmentRow(0.0271, 0.2817, 0.5772, (0.285, 0.269, 0.158)),
        "forearm": SegmentRow(0.0162, 0.2689, 0.4574, (0.276, 0.265, 0.121)),
        "hand": SegmentRow(0.0061, 0.1879, 0.3624, (0.288, 0.235, 0.184)),
        "thigh": SegmentRow(0.1416, 0.4222, 0.4095, (0.329, 0.329, 0.149)),
        "shank": SegmentRow(0.0433, 0.4403, 0.4395, (0.251, 0.246, 0.102)),
        "foot": SegmentRow(0.0137, 0.2581, 0.4415, (0.257, 0.245, 0.124)),
    },
}
"""Rows of de Leva's table by sex and segment.

With both limbs counted, the mass shares add up to 1.0000 for men and 0.9999 for women, as published.
"""

SHOULDER_DROP = {"female": 0.6148 - 0.4979, "male": 0.6033 - 0.5155}
"""Height of the cervicale above the mid-shoulder point in the mean body [m].

The table gives the trunk's length from the cervicale and from the mid-shoulder, both to the midpoint of the hip joints;
this is their difference.
"""

OTHER_LENGTHS = {"shoulder_width": 0.200, "hip_width": 0.100, "ankle_height": 0.039, "heel_to_ankle": 0.037}
"""Lengths that de Leva's table lacks, as shares of the standing height [1].

Distance between both shoulder joint centres, and between both hip joint centres; height of the ankle joint centre above
the sole; distance from the heel forward to the point below the ankle joint centre. ankle_height: Drillis & Contini 1966
as in Winter's textbook, from memory; the others: project default. All are unconfirmed, so measure them.
"""

DENSITY = {
    "head": 1110.0,
    "upper_trunk": 1030.0,
    "middle_trunk": 1030.0,
    "lower_trunk": 1030.0,
    "upper_arm": 1070.0,
    "forearm": 1130.0,
    "hand": 1160.0,
    "thigh": 1050.0,
    "shank": 1090.0,
    "foot": 1100.0,
}
"""Density of each segment [kg/m^3].

Winter, Biomechanics and Motor Control of Human Movement, 3rd ed. 2005, as quoted in the tables of a course (University
of Rhode Island, BME 207, 2016).
"""


def scaled_lengths(sex: str, height: float) -> dict[str, float]:
    """Return the segment lengths and joint distances of a subject, by name [m].

    Args:
        sex: "female" or "male".
        height: standing height [m].
    """
    scale = height / MEAN_HEIGHT[sex]
    lengths = {name: row.length * scale for name, row in DE_LEVA[sex].items()}
    others = {name: share * height for name, share in OTHER_LENGTHS.items()}
    return lengths | {"shoulder_drop": SHOULDER_DROP[sex] * scale} | others


def scaled_masses(sex: str, mass: float) -> dict[str, float]:
    """Return the mass of each segment, limbs of one side [kg]; mass: total body mass [kg]."""
    return {name: row.mass * mass for name, row in DE_LEVA[sex].items()}
