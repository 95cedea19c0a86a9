"""Clean 3D hand-object interaction tracks: no penetration, contact where the object moves."""
