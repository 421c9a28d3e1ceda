"""Outputs for robots and other programs: NMEA over TCP or a serial port, JSON over WebSocket."""

from vgps.config import GpsConfig
from vgps.crs.geoid import egm96
from vgps.online.estimate import OnlineEstimate
from vgps.online.outputs.broadcast import Channel, SerialPort, TcpBroadcast, WebSocketBroadcast
from vgps.online.outputs.nmea_sentences import sentences
from vgps.online.outputs.output import JsonMessages, PoseOutput


class NmeaOutput(PoseOutput):
    """Poses as NMEA 0183, see :mod:`vgps.online.outputs.nmea_sentences`.

    Args:
        address: ``tcp://HOST:PORT`` to listen there, or a serial port with or without ``@BAUD``.
        config: Regions of the fix classes.

    Raises:
        OutputError: The address cannot be opened.
    """

    def __init__(self, address: str, config: GpsConfig) -> None:
        self._config, self._geoid = config, egm96()
        tcp = address.startswith("tcp://")
        self.channel: Channel = TcpBroadcast(address) if tcp else SerialPort(address)

    def write(self, estimate: OnlineEstimate, latency_s: float) -> None:
        """Send the sentences of a pose."""
        self.channel.send(sentences(estimate, self.start_utc, self._geoid, self._config))

    def close(self) -> None:
        """Close the port."""
        self.channel.close()


class WebSocketOutput(JsonMessages):
    """The lines of standard output as messages.

    Args:
        address: ``HOST:PORT`` to listen there.

    Raises:
        OutputError: It cannot be listened on.
    """

    def __init__(self, address: str) -> None:
        self.server = WebSocketBroadcast(address)
        super().__init__(self.server.send)

    def close(self) -> None:
        """Close the port."""
        self.server.close()
