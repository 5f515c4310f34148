"""Command without ROS: python3 -m mocap_natnet.server."""

import sys

from mocap_natnet.server.app import main

if __name__ == "__main__":
    sys.exit(main())
