"""What a search will be like, before it is flown."""
