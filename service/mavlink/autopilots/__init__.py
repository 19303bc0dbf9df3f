"""What differs between autopilots, one small class each."""
