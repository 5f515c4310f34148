"""Node `emulated_emg`: muscles, as an LSL outlet or as a Trigno server."""

from hric_core.ros import RosNode, run
from hric_perception.emg.device import NAME, EmulatedEmg, EmulatedEmgSettings
from hric_perception.emulation import Outlet
from hric_perception.lsl import LslOutlet, use_session
from hric_perception.sensor import EmulatedNode
from hric_perception.simulated import KnownTime
from hric_perception.trigno.server import TrignoServer


class EmulatedEmgNode(EmulatedNode):
    """Emulated EMG that streams from construction on; samples of a simulated human wait for their activation.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or a port is in use.
    """

    def __init__(self, node: RosNode) -> None:
        settings = EmulatedEmgSettings.read(node)
        device = EmulatedEmg(node, settings)
        outlet = make_outlet(settings, device)
        super().__init__(node, device.replayed)
        self.clock = KnownTime(self.robot_time, device.known)
        self._send(device.sensor, outlet, settings.source, settings.block)
        node.log_info(f"{len(settings.muscles)} emulated muscles at {settings.rate:g} Hz by {settings.transport}")


def make_outlet(settings: EmulatedEmgSettings, device: EmulatedEmg) -> Outlet:
    """Return the outlet of the samples. Raises HricError."""
    if settings.transport == "lsl":
        use_session(settings.session)
        return LslOutlet(device.layout, "EMG", settings.name)
    server = TrignoServer(
        settings.rate, settings.ip, settings.command_port, settings.data_port, device.sensor.faults.time_code
    )
    server.start()
    return server


def main(text: str) -> int:
    """Run the node, and return the exit code; text: for --help."""
    return run(NAME, text, EmulatedEmgNode, EmulatedEmgSettings)
