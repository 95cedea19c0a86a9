"""How hands and objects move in a made clip."""
