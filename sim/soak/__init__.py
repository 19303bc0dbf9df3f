"""The soak: real flights of the real service under random faults, with a judge on the wire and one over the journal.

`plan` draws what goes wrong and when, from a seed; `flight` lets it happen to a service, a mock autopilot and a
detector, each a process on real sockets; `judge` reads every frame on the wire and says what must not have been sent;
`audit` reads the journal afterwards. A violation names its seed.
"""
