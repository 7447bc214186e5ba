"""Labelled photos of panels: read and written in the formats that people have."""
