"""Training of the label reader: crops of buttons and plates to texts and kinds."""
