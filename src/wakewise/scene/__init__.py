"""Scene: targets that must stay undisturbed (`targets/`), missions and photographic coverage (`missions/`)."""
