"""Several campaigns of one material: one posterior of the material, each campaign's own nuisances beside it."""
