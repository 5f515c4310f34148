"""Node `emulated_plate`: a force plate, as an LSL outlet or within the frames of an emulated Motive."""

from dataclasses import replace

from hric_core.ros import RosNode, run
from hric_perception.lsl import LslOutlet, use_session
from hric_perception.plate.device import NAME, EmulatedPlate, EmulatedPlateSettings
from hric_perception.plate.natnet import PlateMotive
from hric_perception.sensor import EmulatedNode
from hric_perception.simulated import KnownTime


class EmulatedPlateNode(EmulatedNode):
    """Emulated plate that streams from construction on; a delayed load is sent when it is known.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or a port is in use.
    """

    def __init__(self, node: RosNode) -> None:
        settings = EmulatedPlateSettings.read(node)
        device = EmulatedPlate(node, settings)
        super().__init__(node, device.replayed)
        if settings.transport == "lsl":
            self.clock = KnownTime(self.robot_time, device.known)
            use_session(settings.session)
            outlet = LslOutlet(device.layout, "Force", settings.name)
            self._send(device.sensor(), outlet, settings.source, settings.block)
        else:
            stream = settings.natnet
            if stream.centre is None:
                stream = replace(stream, centre=settings.pose.xyz)
            # A frame goes out its latency after its samples.
            self.clock = KnownTime(self.robot_time, device.known, stream.latency)
            self._source = PlateMotive(
                stream, settings.rate, device.load, device.faults, self.clock, self._progress.reached
            )
        node.log_info(f"an emulated force plate at {settings.rate:g} Hz by {settings.transport}")


def main(text: str) -> int:
    """Run the node, and return the exit code; text: for --help."""
    return run(NAME, text, EmulatedPlateNode, EmulatedPlateSettings)
