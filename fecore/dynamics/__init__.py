"""The dynamics of an affine system: modes, their derivatives, a reduced basis, damping laws,
synthesis of FRFs.

factor, multifrontal, dense  symmetric matrices factorised: sparse by a band or front by front; small ones
eigen                        undamped modes
bodies                       those of a body; a mechanism is named by what moves
sensitivity                  derivatives of eigenvalues and shapes
reduction                    a reduced basis: modes for new coefficients, with their error
laws                         the table of damping laws
damping_laws                 laws of frequency
mechanism_laws               laws by mechanism
synthesis                    modes to FRFs
"""
