"""The doors for detectors beside HTTP: UDP, a Unix socket, and MQTT.

All speak the same: lines of JSON, each a report as in `service.evidence.reports`; each is answered by a receipt, a line
of JSON with the report's id. A report without a receipt may not have arrived and can be sent again, its id keeps it
from being counted twice. They only take reports: whoever can reach one can neither read the state nor give orders.
"""

from service.doors.doors import Doors, open_doors

__all__ = ["Doors", "open_doors"]
