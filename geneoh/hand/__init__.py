"""The hand model: its kinematic tree, the hand that ships, and MANO from the user's files."""
