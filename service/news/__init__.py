"""News from the field: clues, and ground that others have searched."""
