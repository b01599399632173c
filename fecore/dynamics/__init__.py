"""The dynamics of an affine system: modes, their derivatives, a reduced basis, damping laws,
synthesis of FRFs.
"""
