"""A mock multicopter autopilot that answers as PX4 1.16 and ArduCopter 4.7 do.

The core (`core.Autopilot`) does no input or output: bytes come in, vehicle time is advanced in fixed
steps, bytes come out. `transport` carries the bytes over UDP and TCP, `process` starts a mock as a process
of its own, `cli` is `roisearch-sim autopilot`.
"""
