"""Messages reach those who show them decoded, when they show them, and those who keep them as bytes, at once."""

from io import BytesIO

import pytest
from std_msgs.msg import Float64

from hric_view import feeds
from hric_view.feeds import Feed, undecoded


def receive(feed: Feed, *values: float) -> None:
    for value in values:
        Float64(value).serialize(buffer := BytesIO())
        feed.receive(undecoded(Float64)().deserialize(buffer.getvalue()))


def shown(feed: Feed, depth: int = 1, lasting: bool = False) -> list[float]:
    seen: list[float] = []
    feed.show(lambda message: seen.append(message.data), depth, lasting)
    return seen


@pytest.mark.parametrize(("depth", "expected"), [(1, [3.0]), (2, [2.0, 3.0])])
def test_the_newest_messages_are_shown_once(depth: int, expected: list[float]) -> None:
    feed = Feed(Float64, print)
    seen = shown(feed, depth)
    receive(feed, 1.0, 2.0, 3.0)
    feed.deliver()
    feed.deliver()
    assert seen == expected


def test_only_what_lasts_is_shown_late(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feeds, "STALE", 0.0)
    feed = Feed(Float64, print)
    passing, lasting = shown(feed), shown(feed, lasting=True)
    receive(feed, 1.0)
    feed.deliver()
    assert (passing, lasting) == ([], [1.0])


def test_a_message_that_cannot_be_shown_is_told() -> None:
    told: list[str] = []
    feed = Feed(Float64, told.append)
    seen = shown(feed)
    feed.receive(undecoded(Float64)().deserialize(b"short"))
    feed.deliver()
    receive(feed, 1.0)
    feed.deliver()
    assert len(told) == 1 and seen == [1.0]
