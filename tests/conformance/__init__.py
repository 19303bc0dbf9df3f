"""The mock autopilots held to records of a real PX4 and a real ArduCopter.

`exchanges_*` hold short scripted dialogues with one vehicle, each of which yields facts. `records/` has the
facts that the real autopilots gave every time they were asked. `compare` says how close is close enough.
"""
