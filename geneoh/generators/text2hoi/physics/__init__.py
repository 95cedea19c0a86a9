"""Physical corrections of sampled actions: objects that rest and stand, hands that hold, joints."""
