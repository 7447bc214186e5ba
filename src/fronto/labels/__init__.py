"""What is written on buttons and beside them."""
