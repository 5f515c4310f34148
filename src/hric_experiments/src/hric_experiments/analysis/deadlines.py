"""How often the control loop of a run was late, as it says itself. No ROS."""

from hric_bags.parts import PartsReader

DIAGNOSTICS, MISSED = "diagnostic_msgs/msg/DiagnosticArray", "missed deadlines"


def missed(bag: PartsReader) -> int | None:
    """Cycles that began late until the last diagnostics, of all loops; None: no loop said so (headless)."""
    found: dict[str, int] = {}
    for connection, _, raw in bag.chosen(lambda one: one.msgtype == DIAGNOSTICS):
        for status in bag.deserialize(raw, connection.msgtype).status:
            for pair in status.values:
                if pair.key == MISSED:
                    found[status.name] = int(pair.value)
    return sum(found.values()) if found else None
