"""Another scorer: RULA and REBA of one posture [deg], written straight from the published tables and thresholds."""

from typing import Any

import published_tables as published


def band(value: float, *bounds: tuple[float, int]) -> int:
    """Return the score of the first bound that the value does not exceed."""
    return next(score for bound, score in bounds if value <= bound)


def rula_by_hand(p: dict[str, Any], older: bool = False) -> int:
    flexion = p["upper_arm_flexion"]
    arm = 2 if flexion < -20 else band(flexion, (20, 1), (45, 2), (90, 3), (999, 4))
    arm += (p["shoulder_elevation"] > 10) + (p["upper_arm_abduction"] > 20) - p["arm_supported"]
    lower = (1 if 60 <= p["elbow_flexion"] <= 100 else 2) + (abs(p["forearm_inward"]) > 30)
    wrist = band(abs(p["wrist_flexion"]), (5, 1), (15, 2), (999, 3)) + (abs(p["wrist_deviation"]) > 10)
    twist = 2 if abs(p["pronation"]) > 60 else 1
    neck = 4 if p["neck_flexion"] < 0 else band(p["neck_flexion"], (10, 1), (20, 2), (999, 3))
    neck += (abs(p["neck_twist"]) > 10) + (abs(p["neck_bend"]) > 10)
    trunk = 1 if p["trunk_supported"] else band(abs(p["trunk_flexion"]), (5, 1), (20, 2), (60, 3), (999, 4))
    trunk += (abs(p["trunk_twist"]) > 10) + (abs(p["trunk_bend"]) > 10)
    legs = 1 + p["unbalanced"]
    a = published.rula_a(older)[max(1, arm), lower][2 * (wrist - 1) + twist - 1]
    b = published.by_row(published.RULA_B)[neck][2 * (trunk - 1) + legs - 1]
    use = p["held"] > 60 or p["repeats"] >= 4
    load = 0 if p["load"] < 2 else (2 if p["static"] else 1) if p["load"] <= 10 else (3 if p["static"] else 2)
    added = use + (3 if p["shock"] else load)
    return published.by_row(published.RULA_C)[min(8, a + added)][min(7, b + added) - 1]


def reba_by_hand(p: dict[str, Any], coupling: int = 1) -> int:
    """Return the REBA score; coupling: 0 good, 1 fair."""
    neck = 1 if 0 <= p["neck_flexion"] <= 20 else 2
    neck += abs(p["neck_twist"]) > 10 or abs(p["neck_bend"]) > 10
    lean = p["trunk_flexion"]
    trunk = 3 if lean < -20 else 2 if lean < -5 else band(lean, (5, 1), (20, 2), (60, 3), (999, 4))
    trunk += abs(p["trunk_twist"]) > 10 or abs(p["trunk_bend"]) > 10
    knee = 0 if p["sitting"] or p["knee_flexion"] < 30 else 1 if p["knee_flexion"] <= 60 else 2
    legs = 1 + p["unbalanced"] + knee
    arm = 2 if p["upper_arm_flexion"] < -20 else band(p["upper_arm_flexion"], (20, 1), (45, 2), (90, 3), (999, 4))
    arm += p["upper_arm_abduction"] > 20 or abs(p["upper_arm_rotation"]) > 30
    arm += (p["shoulder_elevation"] > 10) - p["arm_supported"]
    lower = 1 if 60 <= p["elbow_flexion"] <= 100 else 2
    wrist = 1 if abs(p["wrist_flexion"]) <= 15 else 2
    wrist += abs(p["wrist_deviation"]) > 10 or abs(p["pronation"]) > 60
    a = published.reba_a()[neck][4 * (trunk - 1) + legs - 1]
    b = published.reba_b()[max(1, arm)][3 * (lower - 1) + wrist - 1]
    a += (0 if p["load"] < 5 else 1 if p["load"] <= 10 else 2) + p["shock"]
    c = published.by_row(published.REBA_C)[a][b + coupling - 1]
    return c + (p["held"] > 60) + (p["repeats"] > 4) + p["rapid"]
