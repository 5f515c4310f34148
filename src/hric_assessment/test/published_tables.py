"""The published tables as they were noted from the sources, by hand and apart from config/tables: what the files are
held against, cell by cell. Key of the states: C2 in two or more public sources, C in one, U from memory."""

import re

ANNEX_A = """
| 1 | skull, forehead | middle of forehead | 130 | 130 | none | C2 |
| 2 | skull, forehead | temple | 110 | 130 | none | C2 |
| 3 | face | masticatory muscle | 110 | 65 | none | C2 |
| 4 | neck | neck muscle | 140 | 150 | 300 | C2 |
| 5 | neck | seventh neck (C7) | 210 | 150 | 300 | C2 |
| 6 | back, shoulders | shoulder joint | 160 | 210 | 420 | C |
| 7 | back, shoulders | fifth lumbar vertebra | 210 | 210 | 420 | C |
| 8 | chest | sternum | 120 | 140 | 280 | C2 |
| 9 | chest | pectoral muscle | 170 | 140 | 280 | C2 |
| 10 | abdomen | abdominal muscle | 140 | 110 | 220 | C |
| 11 | pelvis | pelvic bone | 210 | 180 | 360 | C |
| 12 | upper arm, elbow | deltoid | 190 | 150 | 300 | C2 |
| 13 | upper arm, elbow | humerus | 220 | 150 | 300 | C2 |
| 14 | lower arm, wrist | radial bone | 190 | 160 | 320 | C |
| 15 | lower arm, wrist | forearm muscle | 180 | 160 | 320 | C2 |
| 16 | lower arm, wrist | arm nerve | 180 | 160 | 320 | C2 |
| 17 | hand, fingers | forefinger pad, dominant | 300 | 140 | 280 | C2 |
| 18 | hand, fingers | forefinger pad, non-dominant | 270 | 140 | 280 | C |
| 19 | hand, fingers | forefinger end joint, dominant | 280 | 140 | 280 | C2 |
| 20 | hand, fingers | forefinger end joint, non-dominant | 220 | 140 | 280 | C |
| 21 | hand, fingers | thenar eminence | 200 | 140 | 280 | C2 |
| 22 | hand, fingers | palm, dominant | 260 | 140 | 280 | C2 |
| 23 | hand, fingers | palm, non-dominant | 260 | 140 | 280 | U |
| 24 | hand, fingers | back of hand, dominant | 200 | 140 | 280 | C2 |
| 25 | hand, fingers | back of hand, non-dominant | 190 | 140 | 280 | C |
| 26 | thigh, knee | thigh muscle | 250 | 220 | 440 | C |
| 27 | thigh, knee | kneecap | 220 | 220 | 440 | C |
| 28 | lower leg | middle of shin | 220 | 130 | 260 | C |
| 29 | lower leg | calf muscle | 210 | 130 | 260 | C |
"""
"""number, region, area, quasi-static pressure [N/cm^2], quasi-static and transient force [N], state"""

BODY_MODEL = """
| skull, forehead | 150 | 4.4 | 130 | 0.056 | 0.29 | 0.23 | 0.21 | 0.20 | 0.19 | 0.18 |
| face | 75 | 4.4 | 65 | 0.028 | 0.20 | 0.16 | 0.15 | 0.14 | 0.14 | 0.13 |
| neck | 50 | 1.2 | 300 | 0.900 | 1.55 | 1.40 | 1.34 | 1.31 | 1.30 | 1.27 |
| back, shoulders | 35 | 40 | 420 | 2.520 | 1.63 | 1.18 | 0.98 | 0.87 | 0.79 | 0.68 |
| chest | 25 | 40 | 280 | 1.568 | 1.28 | 0.93 | 0.78 | 0.69 | 0.63 | 0.54 |
| abdomen | 10 | 40 | 220 | 2.420 | 1.59 | 1.15 | 0.96 | 0.85 | 0.78 | 0.67 |
| pelvis | 25 | 40 | 360 | 2.592 | 1.65 | 1.19 | 1.00 | 0.88 | 0.80 | 0.69 |
| upper arm, elbow | 30 | 3 | 300 | 1.500 | 1.58 | 1.32 | 1.22 | 1.17 | 1.14 | 1.10 |
| lower arm, wrist | 40 | 2 | 320 | 1.280 | 1.60 | 1.39 | 1.31 | 1.26 | 1.24 | 1.20 |
| hand, fingers | 75 | 0.6 | 280 | 0.523 | 1.50 | 1.42 | 1.38 | 1.37 | 1.36 | 1.35 |
| thigh, knee | 50 | 75 | 440 | 1.936 | 1.41 | 1.01 | 0.83 | 0.73 | 0.66 | 0.56 |
| lower leg | 60 | 75 | 260 | 0.563 | 0.76 | 0.54 | 0.45 | 0.39 | 0.36 | 0.30 |
"""
"""region, spring [N/mm], mass [kg], force [N], energy [J], speed [m/s] for robots of 2, 4, 6, 8, 10 and 15 kg"""

BGIA = """
skull-forehead 130/175/30/150; face 65/90/20/75; neck side-nape 145/190/50/50; neck front-larynx 35/35/10/10;
back-shoulder 210/250/70/35; chest 140/210/45/25; abdomen 110/160/35/10; pelvis 180/250/75/25; buttock 210/250/80/15;
upper arm-elbow 150/190/50/30; lower arm-wrist 160/220/50/40; hand-finger 135/180/60/75; thigh-knee 220/250/80/50;
lower leg 140/170/45/60; foot-toe-ankle 125/160/45/75
"""
"""region clamping force [N]/impact force [N]/pressure [N/cm^2]/spring [N/mm]"""

RULA_A = """
| 1,1 | 1 2 2 2 2 3 3 3 | |
| 1,2 | 2 2 2 2 3 3 3 3 | |
| 1,3 | 2 3 3 3 3 3 4 4 | 2 3 2 3 3 3 4 4 |
| 2,1 | 2 3 3 3 3 4 4 4 | 2 2 2 3 3 3 4 4 |
| 2,2 | 3 3 3 3 3 4 4 4 | 2 2 2 3 3 3 4 4 |
| 2,3 | 3 4 4 4 4 4 5 5 | 2 3 3 3 3 4 4 5 |
| 3,1 | 3 3 4 4 4 4 5 5 | 2 3 3 3 4 4 5 5 |
| 3,2 | 3 4 4 4 4 4 5 5 | 2 3 3 3 4 4 5 5 |
| 3,3 | 4 4 4 4 4 5 5 5 | 2 3 3 4 4 4 5 5 |
| 4,1 | 4 4 4 4 4 5 5 5 | 3 4 4 4 4 4 5 5 |
| 4,2 | 4 4 4 4 4 5 5 5 | 3 4 4 4 4 4 5 5 |
| 4,3 | 4 4 4 5 5 5 6 6 | 3 4 4 5 5 5 6 6 |
| 5,1 | 5 5 5 5 5 6 6 7 | |
| 5,2 | 5 6 6 6 6 7 7 7 | |
| 5,3 | 6 6 6 7 7 7 7 8 | |
| 6,1 | 7 7 7 7 7 8 8 9 | |
| 6,2 | 8 8 8 8 8 9 9 9 | |
| 6,3 | 9 9 9 9 9 9 9 9 | |
"""
"""upper arm, lower arm; wrist 1 to 4 with twist 1, 2; the same in older worksheets where they differ"""

RULA_B = """
1: 1 3 2 3 3 4 5 5 6 6 7 7 / 2: 2 3 2 3 4 5 5 5 6 7 7 7 / 3: 3 3 3 4 4 5 5 6 6 7 7 7 /
4: 5 5 5 6 6 7 7 7 7 7 8 8 / 5: 7 7 7 7 7 8 8 8 8 8 8 8 / 6: 8 8 8 8 8 8 8 9 9 9 9 9
"""
RULA_C = """
1: 1 2 3 3 4 5 5 / 2: 2 2 3 4 4 5 5 / 3: 3 3 3 4 4 5 6 / 4: 3 3 3 4 5 6 6 /
5: 4 4 4 5 6 7 7 / 6: 4 4 5 6 6 7 7 / 7: 5 5 6 6 7 7 7 / 8: 5 5 6 7 7 7 7
"""
REBA_A = """
neck 1: 1234 2345 2456 3567 4678 / neck 2: 1234 3456 4567 5678 6789 / neck 3: 3356 4567 5678 6789 7899
"""
REBA_B = """
122 123 / 123 234 / 345 455 / 455 567 / 678 788 / 788 899
"""
REBA_C = """
1: 1 1 1 2 3 3 4 5 6 7 7 7 / 2: 1 2 2 3 4 4 5 6 6 7 7 8 / 3: 2 3 3 3 4 5 6 7 7 8 8 8 / 4: 3 4 4 4 5 6 7 8 8 9 9 9 /
5: 4 4 4 5 6 7 8 8 9 9 9 9 / 6: 6 6 6 7 8 8 9 9 10 10 10 10 / 7: 7 7 7 8 9 9 9 10 10 11 11 11 /
8: 8 8 8 9 10 10 10 10 10 11 11 11 /
9: 9 9 9 10 10 10 11 11 11 12 12 12 / 10: 10 10 10 11 11 11 11 12 12 12 12 12 /
11: 11 11 11 11 12 12 12 12 12 12 12 12 / 12: 12 12 12 12 12 12 12 12 12 12 12 12
"""
NIOSH_FREQUENCY = """
0.2: 1 .95 .85; 0.5: .97 .92 .81; 1: .94 .88 .75; 2: .91 .84 .65; 3: .88 .79 .55;
4: .84 .72 .45; 5: .80 .60 .35; 6: .75 .50 .27; 7: .70 .42 .22; 8: .60 .35 .18; 9: .52 .30 0/.15; 10: .45 .26 0/.13;
11: .41 0/.23 0;
12: .37 0/.21 0; 13: 0/.34 0 0; 14: 0/.31 0 0; 15: 0/.28 0 0
"""
"""lifts a minute: for up to 1, 2 and 8 hours; two values: hands below 75 cm, and from there on"""


def cells(text: str) -> list[list[str]]:
    """Return the cells of a text table whose columns are separated by bars."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.strip().splitlines()]


def rula_a(older: bool = False) -> dict[tuple[int, ...], list[int]]:
    """Return RULA's table A by (upper arm, lower arm): scores for wrist 1 to 4, each with twist 1 and 2."""
    found = {}
    for row, current, before in cells(RULA_A):
        upper, lower = map(int, row.split(","))
        found[upper, lower] = [int(score) for score in ((before if older else "") or current).split()]
    return found


def by_row(text: str) -> dict[int, list[int]]:
    """Return the scores of a table by the number of the row."""
    rows = [row.split(":") for row in text.replace("\n", " ").split("/") if row.strip()]
    return {int(number): [int(score) for score in scores.split()] for number, scores in rows}


def reba_a() -> dict[int, list[int]]:
    """Scores by neck: trunk 1 to 5, each with legs 1 to 4."""
    rows = [row.replace("neck", "").split(":") for row in REBA_A.strip().split("/")]
    return {int(neck): [int(digit) for digit in scores.replace(" ", "")] for neck, scores in rows}


def reba_b() -> dict[int, list[int]]:
    """Scores by upper arm: lower arm 1 and 2, each with wrist 1 to 3."""
    return {
        arm: [int(digit) for digit in row.replace(" ", "").strip()]
        for arm, row in enumerate(REBA_B.strip().split("/"), 1)
    }


def bgia() -> dict[str, list[float]]:
    """Clamping force, impact force, pressure, spring by region."""
    found = re.findall(r"([a-z][a-z -]*?) ([\d/]+)", " ".join(BGIA.split()))
    return {name: [float(value) for value in values.split("/")] for name, values in found}


def niosh_frequency() -> dict[float, list[float]]:
    """Six multipliers by lifts a minute: three durations, each below and from 75 cm on."""
    found = {}
    for row in NIOSH_FREQUENCY.split(";"):
        frequency, values = row.split(":")
        pairs = [value.split("/") for value in values.split()]
        found[float(frequency)] = [float(one) for pair in pairs for one in (pair[0], pair[-1])]
    return found
