"""A body and its affine system: geometry, material, supports and elements to K(c) and M(m)."""
