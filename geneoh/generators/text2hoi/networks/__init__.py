"""The networks of Text2HOI, what they read and write, and their shipped weights."""
