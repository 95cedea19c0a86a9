"""The networks of Text2HOI, their inputs, outputs and losses, and their shipped weights."""
