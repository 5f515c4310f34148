"""Command without ROS: python3 -m mocap_natnet.server."""

import sys

from mocap_natnet.server.app import EmulatedMotiveCommand

if __name__ == "__main__":
    command = EmulatedMotiveCommand()
    sys.exit(command.run(command.parser("emulated_motive").parse_args()))
