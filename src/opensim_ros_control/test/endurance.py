"""Runs plants for long in a process of its own and reports how its memory went: python endurance.py motion|builds|exit
<config as JSON> <amount>."""

import json
import sys

import panda_description
from opensim_ros_control.plant import OpenSimPlant

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
POSE = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
REPORTS = 10


def memory():
    """Resident memory of this process [MiB]."""
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmRSS"))


def motion(plant, amount):
    """Swing about POSE for `amount` steps."""
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    plant.reset(POSE)
    for k in range(amount):
        plant.read_state(q, dq, tau)
        side = 0.2 if k // 500 % 2 else -0.2
        plant.apply([50.0 * (x + side - now) - 5.0 * v for x, now, v in zip(POSE, q, dq, strict=True)])
        plant.step()
        if (k + 1) % (amount // REPORTS) == 0:
            print(memory(), flush=True)


def builds(urdf, config, amount):
    """Build `amount` plants, each of which steps a little."""
    for k in range(amount):
        plant = OpenSimPlant(urdf, JOINTS, config)
        motion_steps(plant)
        plant.close()
        if (k + 1) % (amount // REPORTS) == 0:
            print(memory(), flush=True)


def motion_steps(plant):
    """A few steps of an arm that falls."""
    plant.reset(POSE)
    for _ in range(3):
        plant.apply([0.0] * 7)
        plant.step()


def main():
    what, config, amount = sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3])
    urdf = panda_description.load(meshes=False)
    if what == "motion":
        motion(OpenSimPlant(urdf, JOINTS, config), amount)
    elif what == "builds":
        builds(urdf, config, amount)
    else:
        plants = [OpenSimPlant(urdf, JOINTS, config) for _ in range(amount)]
        for plant in plants:
            motion_steps(plant)
        plants[0].set_brakes([True] * 7)
        print(memory())


if __name__ == "__main__":
    main()
