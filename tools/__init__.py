"""What is made from code and kept in the tree: `python -m tools.reference`."""
