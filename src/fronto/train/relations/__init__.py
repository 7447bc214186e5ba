"""Training of the relation head: which of the network's candidates are buttons."""
