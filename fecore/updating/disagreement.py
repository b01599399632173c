"""Where the damping law fitted to the FRFs and the damping ratios of the identified modes disagree.

The FRFs are fitted with the model's own shapes and frequencies, the modes were identified without the model: what a wrong
clamp, an unstated sensor or a delay leaves in the FRFs moves the first and not the second. With a the law from the FRFs and a_r
the one that comes nearest to the ratios, d = a - a_r has the variance V by noise and by the scatter of the modes about the law;
what d² has above V is an error of the model, and enters the variance of a.
"""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray


def disagreement(
    basis: FloatArray, noise: FloatArray, spread: float, coefficients: FloatArray, coefficient_noise: FloatArray
) -> FloatArray:
    """(p,) standard deviations that a model's errors add to a law's coefficients.

    Args:
        basis: (n, p) relative derivative of the measured ratios by the coefficients: basis @ a = 1 where a law holds.
        noise: (n, n) relative covariance of the ratios by noise.
        spread: relative standard deviation of a ratio about the law.
        coefficients: (p,) the law fitted to the FRFs.
        coefficient_noise: (p, p) their covariance by noise.
    """
    weight = np.linalg.inv(noise + spread**2 * np.eye(len(noise)))
    scale = np.linalg.norm(basis, axis=0)
    scale[scale == 0] = 1.0
    scaled = basis / scale
    near = np.linalg.pinv(scaled.T @ weight @ scaled, hermitian=True)
    apart = coefficients - near @ scaled.T @ weight @ np.ones(len(basis)) / scale
    expected = np.diag(near) / scale**2 + np.diag(coefficient_noise)
    added: FloatArray = np.sqrt(np.maximum(apart**2 - expected, 0))
    return added
