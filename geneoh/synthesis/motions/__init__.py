"""How hands and objects move in a synthetic clip."""
