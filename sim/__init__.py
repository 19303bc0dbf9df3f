"""What stands in for the world: mock autopilot, target, detector, trials."""
