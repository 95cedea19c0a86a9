"""What physics asks of a drawn action: objects that rest and stand, hands that hold, joints."""
