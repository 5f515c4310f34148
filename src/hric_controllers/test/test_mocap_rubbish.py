"""Mutated and random datagrams among the genuine ones, with the controller at the end of the way: nothing crashes,
hangs, grows or jumps."""

import contextlib
import gc
import itertools
import logging
import resource

import pytest
from mocap_rig import MocapRig
from natnet_rubbish import Rubbish

from mocap_natnet.codec import REASONS
from mocap_natnet.server import CameraFaults, Motive, MotiveSettings, SceneBody, ServedScene, SinusoidSource
from mocap_natnet.tracking.validity import REASONS as IMPLAUSIBLE

SESSION_REASONS = {
    *REASONS,
    "late",
    "duplicate",
    "number",
    "echo",
    "unasked",
    "before server information",
    "before the clock is known",
}
EACH_CYCLE = 50
VERSIONS = ((4, 1), (3, 0), (2, 9), (4, 2), (3, 1), (2, 10), (4, 0))


class Besieged(MocapRig):
    """In each cycle so many spoilt datagrams arrive beside the genuine stream; from time to time the server speaks
    another bitstream.

    Attributes:
        sent: spoilt datagrams so far.
        arrived: all that the client got.
    """

    def __init__(self, versions=VERSIONS, **changes):
        scene = ServedScene(
            (SceneBody("hand", SinusoidSource((0.0, 0.0, 1.0), (0.05, 0.1, 0.03))),), (), CameraFaults(noise=1e-4)
        )
        super().__init__(Motive(MotiveSettings(version=versions[0]), scene), **changes)
        self.sent = self.arrived = 0
        self._versions, self._genuine = versions, b""
        self._rubbish = {version: Rubbish(version, seed) for seed, version in enumerate(versions)}
        self.besieged = False
        receive = self.session.receive

        def counted(datagram, now):
            self.arrived += 1
            receive(datagram, now)

        self.session.receive = counted
        self.link.keep = self._keep

    def _keep(self, datagram):
        self._genuine = datagram
        return datagram

    def speak(self, version):
        self.link.motive.change_version(version)

    def marker_cycle(self, time):
        super().marker_cycle(time)
        if self.besieged:
            rubbish = self._rubbish[self.link.motive.version]
            for _ in range(EACH_CYCLE):
                self.session.receive(rubbish.datagram(self._genuine), self.link.now)
            self.sent += EACH_CYCLE

    def siege(self, seconds):
        self.besieged = True
        self.follow(seconds)
        self.besieged = False

    def check_counts(self):
        """Each datagram is taken or refused by a reason, and each frame that is taken is published or says why not."""
        statistics, implausible = self.session.statistics, self.publisher.tracker.validator.refused
        assert sum(statistics.taken.values()) + sum(statistics.refused.values()) == self.arrived >= self.sent
        assert set(statistics.refused) <= SESSION_REASONS and set(implausible) <= set(IMPLAUSIBLE)
        assert statistics.frames == statistics.taken["FRAMEOFDATA"]


@pytest.fixture(autouse=True)
def quiet():
    """A line of the log for each lost marker is not what is tested here."""
    logger = logging.getLogger("hric")
    before, logger.level = logger.level, logging.CRITICAL
    yield
    logger.level = before


def test_spoilt_datagrams_in_any_number_cause_no_jump_and_are_counted_by_reason():
    bench = Besieged().follow(0.5)
    for version in VERSIONS[:4]:
        bench.speak(version)
        bench.siege(0.1)
    bench.check_within_limits()
    bench.check_counts()
    assert bench.sent == 20_000
    assert {"short", "length", "count", "size", "name", "end tag", "unknown message", "unasked"} <= set(
        bench.session.statistics.refused
    )
    assert "not described" in bench.publisher.tracker.validator.refused


def test_when_the_siege_ends_the_marker_is_followed_within_two_seconds():
    bench = Besieged(((4, 1),)).follow(0.3)
    bench.siege(0.1)
    bench.follow(2.0)
    bench.check_within_limits()
    bench.check_counts()
    assert bench.last_state().tracking == "following"
    assert bench.session.model is not None and bench.publisher.tracker.name(1) == "hand"


@contextlib.contextmanager
def no_growth(objects, kilobytes):
    """At the end there are no more objects than at the beginning, and the process is no larger, within these."""
    gc.collect()
    before, size = len(gc.get_objects()), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    gc.collect()
    assert len(gc.get_objects()) - before < objects
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - size < kilobytes


@pytest.mark.slow
def test_a_million_spoilt_datagrams_with_the_controller_attached_leave_nothing_behind():
    bench = Besieged().follow(0.5)
    versions = itertools.cycle(VERSIONS)
    bench.node._core.taps.clear()  # the rig keeps messages; what the controller and the client keep is measured
    while bench.sent < 100_000:
        bench.speak(next(versions))
        bench.siege(0.2)
    with no_growth(20_000, 20_000):
        while bench.sent < 1_100_000:
            bench.speak(next(versions))
            bench.siege(0.4)
            bench.check_within_limits()
            bench.rows = bench.rows[-4:]
            bench.torques.clear()
    bench.check_counts()
    bench.follow(2.0)
    assert bench.session.statistics.rate(bench.link.now) > 200
