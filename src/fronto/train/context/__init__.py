"""Training of the context head, which names the buttons of a panel together."""
