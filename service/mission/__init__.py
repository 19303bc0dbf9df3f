"""The flight: one state machine, and everything that speaks for or against moving the aircraft."""
