"""Training of the verifier, which tells of each find by itself what it is."""
