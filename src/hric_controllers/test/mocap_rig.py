"""The whole way of a marker in one process: emulated Motive, datagrams, client, publisher, topics, controller,
simulated arm. No sockets."""

import numpy as np
from arm_rig import ArmRig
from natnet_link import START, Link

from mocap_natnet.client import ClientSettings as ClientSettings
from mocap_natnet.client import Session
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher

NAME = "cartesian_pose_controller"
STATE = f"/{NAME}/state"
MOCAP = "/hric/perception/mocap"
VELOCITY, ACCELERATION, JERK = 0.7, 2.0, 50.0
"""The limits of controllers.yaml [m/s], [m/s^2], [m/s^3]."""


class MocapArm(ArmRig):
    """The arm with its controller and a publisher of motion capture on the same node. `marker_cycle(time)` comes before
    the controller's next cycle.

    Args:
        mocap: parameters of the publisher, as natnet_client has them.
        changes: parameters of the controller.

    Attributes:
        publisher: takes frames.
        rows: (robot time, setpoint of the position in the base) of each cycle so far.
    """

    def __init__(self, mocap=None, **changes):
        super().__init__(NAME, **changes)
        self.node.set_param("mocap", mocap or {})
        self.publisher = MocapPublisher(self.node, Publishing.read(self.node.child("mocap")), self.robot_time)
        self.rows = []

    def robot_time(self, monotonic):
        """Return the robot time [s] of a time of the client's clock [ns]."""
        return (monotonic - START) * 1e-9

    def marker_cycle(self, time):
        raise NotImplementedError

    def follow(self, seconds):
        self.run(seconds, self._on_cycle)
        return self

    def _on_cycle(self, time):
        self.marker_cycle(time)
        self.rows.append((time, self.state.O_T_EE_c[12:15]))

    @property
    def times(self):
        return np.array([time for time, _ in self.rows])

    @property
    def desired(self):
        """Return the desired positions, shape (n, 3) [m]."""
        return np.array([position for _, position in self.rows])

    def check_within_limits(self):
        """No step of the setpoint is beyond the limits of the motion: that is what "no jump" means."""
        assert not self.hw.error
        for order, limit, rounding in ((1, VELOCITY, 1e-5), (2, ACCELERATION, 1e-5), (3, JERK, 1e-2)):
            largest = np.linalg.norm(np.diff(self.desired, n=order, axis=0), axis=1).max() * 1e3**order
            assert largest <= limit * (1 + rounding), f"derivative {order} of the setpoint: {largest}"

    def last_state(self):
        return self.messages[STATE][-1]


class MocapRig(MocapArm):
    """Fed by a `Link`: server and client talk over a simulated network.

    Args:
        motive: the emulated Motive, its stream begins with the arm's robot time.
        client: settings of the client.
    """

    def __init__(self, motive, mocap=None, client=None, **changes):
        super().__init__(mocap, **changes)
        self.link = Link(motive)
        publisher = self.publisher
        self.session = self.link.session = Session(
            client or ClientSettings(), publisher.publish, publisher.describe, publisher.restart
        )

    def marker_cycle(self, time):
        if time > self.link.time:
            self.link.run(time - self.link.time - 5e-4)
