"""Updates: a model's constants and damping are estimated from what campaigns measured."""
