"""Scene: targets (`targets/`), missions and coverage (`missions/`)."""
