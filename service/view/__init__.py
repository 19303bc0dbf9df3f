"""A run as people and programs see it: live, or replayed from its journal."""
