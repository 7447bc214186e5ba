"""Training of the edge head: which of the photo's edges is a button's."""
