"""Person who moves their whole upper body in a laboratory, with markers on them, computed by pinocchio."""

from collections.abc import Mapping

import numpy as np
import pinocchio

from hric_human.body import Body

RATE = 120.0


class Mover:
    """A body whose root and joints swing, away from the singularity of the shoulder.

    Args:
        body: true body of the person.
        speed: factor on the speed of the swings [1].
        seed: seed of phases and rates.
        within: lower and upper angle by joint, where the person swings in less than its range [rad].
    """

    def __init__(
        self,
        body: Body,
        speed: float = 1.0,
        seed: int = 1,
        within: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.body, self._random = body, np.random.default_rng(seed)
        self.model = pinocchio.buildModelFromXML(body.urdf, pinocchio.JointModelFreeFlyer())
        self.data = self.model.createData()
        low, high = np.array([(within or {}).get(name, joint.range) for name, joint in body.joints.items()]).T
        high = np.minimum(high, np.radians(75))
        self._middle, self._swing = 0.5 * (low + high), 0.4 * (high - low)
        self._phase = self._random.uniform(0, 2 * np.pi, len(low))
        self._rate = speed * self._random.uniform(0.5, 1.5, len(low))
        joints = [self.model.joints[self.model.getJointId(name)] for name in body.joints]
        self._q, self._v = [joint.idx_q for joint in joints], [joint.idx_v for joint in joints]

    def joints(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and accelerations, n each [rad]."""
        w, a = self._rate, self._swing
        phase = w * time + self._phase
        return self._middle + a * np.sin(phase), a * w * np.cos(phase), -a * w * w * np.sin(phase)

    def root(self, time: float) -> pinocchio.SE3:
        """The person sways and turns."""
        x, y = 0.05 * np.sin(1.3 * time), 0.05 * np.sin(0.9 * time)
        turn = pinocchio.exp3(np.array([x, y, 2.5 + 0.3 * np.sin(time)]))
        return pinocchio.SE3(turn, np.array([0.8 + 0.1 * np.sin(0.8 * time), -0.3 + 0.05 * np.sin(time), 0.95]))

    def state(self, time: float) -> np.ndarray:
        """Return the positions in pinocchio's order."""
        q = np.zeros(self.model.nq)
        q[:7], q[self._q] = pinocchio.SE3ToXYZQUAT(self.root(time)), self.joints(time)[0]
        return q

    def torque(self, time: float, link: str, force: np.ndarray, torque: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return the torques that the joints need, n [N m], with a force and a torque on a link.

        The force is in [N], at a point [m], the torque in [N m]. Vectors are in axes of the world; root and joints move
        with differences of their positions.
        """
        h = 1e-4
        before, now, after = (self.state(time + dt) for dt in (-h, 0.0, h))
        forth, back = (pinocchio.difference(self.model, *pair) / h for pair in ((now, after), (before, now)))
        acting = pinocchio.StdVec_Force([pinocchio.Force.Zero() for _ in range(self.model.njoints)])
        pinocchio.forwardKinematics(self.model, self.data, now)
        joint = self.model.frames[self.model.getFrameId(link)].parentJoint
        acting[joint] = self.data.oMi[joint].actInv(pinocchio.Force(force, torque + np.cross(point, force)))
        tau = pinocchio.rnea(self.model, self.data, now, (forth + back) / 2.0, (forth - back) / h, acting)
        return np.asarray(tau[self._v])

    def place(self, time: float, joints: np.ndarray | None = None) -> None:
        """Put the model where the person is; joints: in place of those that swing [rad]."""
        q = np.zeros(self.model.nq)
        q[:7] = pinocchio.SE3ToXYZQUAT(self.root(time))
        q[self._q] = self.joints(time)[0] if joints is None else joints
        pinocchio.framesForwardKinematics(self.model, self.data, q)

    def point(self, link: str, p_link: np.ndarray) -> np.ndarray:
        """Return the current position of a point of a link in the world [m]."""
        return np.asarray(self.data.oMf[self.model.getFrameId(link)].act(p_link))

    def markers(
        self, time: float, offsets: dict[str, np.ndarray] | None = None, joints: np.ndarray | None = None
    ) -> np.ndarray:
        """Marker positions of the person, shape (m, 3) [m].

        Args:
            time: time of the motion [s].
            offsets: displacement of each marker from its position on the body, in axes of its link [m].
            joints: see `place`.
        """
        self.place(time, joints)
        return np.array([
            self.point(marker.link, marker.p_link_marker + (offsets or {}).get(name, 0.0))
            for name, marker in self.body.markers.items()
        ])  # fmt: skip

    def hand(self, time: float, side: str = "right") -> np.ndarray:
        """Return the position of a hand's centre of mass in the world [m]."""
        self.place(time)
        hand = self.body.segments[f"{side}_hand"]
        return self.point(hand.link, hand.mass.com)
