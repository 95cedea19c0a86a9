"""What the networks of Text2HOI learn from, and how."""
