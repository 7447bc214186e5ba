"""Training of the mask head, which draws the exact mask of each find."""
