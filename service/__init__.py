"""The process beside the flight controller: area, link, mission, HTTP door."""
