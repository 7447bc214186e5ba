"""Training of the segmentation network: the only room that PyTorch enters."""
