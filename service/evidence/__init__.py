"""From a detector's report to what the search may believe: checked, placed, journalled, and only then applied."""
