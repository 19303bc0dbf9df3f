"""What a team takes away from a run: one file for each format, all made from one plain `Run` (see `run`)."""
