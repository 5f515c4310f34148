"""The trail of the followed body."""

import itertools
from typing import Any

from visualization_msgs.msg import Marker

from hric_core.geometry import stamped
from hric_core.local.node import LocalNode
from mocap_natnet.node.publisher import PIECE, POINTS_RATE, TRAIL_TOPIC, Trail


def pieces(*spans: tuple[int, int]) -> list[Any]:
    """Return the messages published while a body moves along x at 1 m/s, tracked at 240 Hz in these spans of frames."""
    node, seen = LocalNode({}), []
    node.subscribe(TRAIL_TOPIC, Marker, seen.append)
    trail = Trail(node, 8.0)
    for number in itertools.chain.from_iterable(itertools.starmap(range, spans)):
        trail.add(stamped.header(None, "mocap"), number / 240.0, (number / 240.0, 0.0, 1.0))
    return seen


def test_the_line_goes_on_from_piece_to_piece_at_a_low_rate() -> None:
    seen = pieces((0, 1200))
    assert len(seen) <= 5.0 * POINTS_RATE / PIECE
    assert all(a.points[-1] == b.points[0] for a, b in itertools.pairwise(seen))
    assert len({piece.id for piece in seen}) == len(seen)
    assert {piece.lifetime.to_sec() for piece in seen} == {8.0}
    assert seen[0].points[0].x == 0.0 and seen[-1].points[-1].x > 4.5


def test_the_line_is_broken_where_the_body_was_not_seen() -> None:
    for piece in pieces((0, 600), (840, 1200)):
        assert max(b.x - a.x for a, b in itertools.pairwise(piece.points)) < 0.03
