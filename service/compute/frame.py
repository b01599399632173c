"""The specimen's frame and the measured file's coordinates.

The specimen's frame has x along the length from the clamped end, y across from -b/2 to b/2 and z
out of plane. A file may have been measured in other axes; a campaign's `frame` states where they
put the specimen: the origin and the unit vectors e_x, e_y of the specimen's axes in the file's
coordinates. With E = [e_x, e_y, e_x × e_y] (columns),

    x_specimen = Eᵀ (x_file - origin).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.frf import Dof

# axes typed with four digits pass; what is left of the error is removed by Gram-Schmidt
ORTHONORMAL_TOLERANCE = 1e-3


SQUARE = 1e-6  # within which a direction cosine is 1


@dataclass(frozen=True)
class Frame:
    """Where a file's coordinates put the specimen."""

    origin_m: FloatArray  # (3,) origin of the specimen's frame, in the file's coordinates, m
    # (3, 3) right-handed orthonormal; columns are the specimen's x, y, z in the file's coordinates
    axes: FloatArray

    def points(self, file_m: FloatArray) -> FloatArray:
        """Points of the file in the specimen's frame.

        Args:
            file_m: (n, 3) coordinates in the file, m.

        Returns:
            (n, 3) x along the length from the clamped end, y across, z out of plane, m.
        """
        return (file_m - self.origin_m) @ self.axes

    @property
    def is_askew(self) -> bool:
        """Whether the file's axes lie along none of the specimen's."""
        return bool(np.abs(self.axes).max(axis=0).min() < 1 - SQUARE)

    def point_axes(self, labels: Iterable[int]) -> dict[int, FloatArray]:
        """(3, 3) directions 1, 2 and 3 at points, as rows in the specimen's frame, where they are
        not its axes.
        """
        return dict.fromkeys(labels, self.axes) if self.is_askew else {}

    def dof(self, dof: Dof) -> Dof:
        """A degree of freedom of the file, with its direction in the specimen's frame.

        Of a frame that lies askew it is as it was: `point_axes` says where its directions point.
        """
        if self.is_askew:
            return dof
        rotation = 3 if dof.axis > 3 else 0
        # the file's unit vector, in the specimen's axes
        along = dof.sign * self.axes[dof.axis - 1 - rotation]
        axis = int(np.argmax(np.abs(along)))
        return Dof(dof.point, (axis + 1 + rotation) * (1 if along[axis] > 0 else -1))

    def file_dof(self, dof: Dof) -> Dof:
        """A degree of freedom of the specimen's frame, with its direction in the file's
        coordinates: undoes `dof`.
        """
        return Frame(self.origin_m, self.axes.T).dof(dof)


def make_frame(
    origin_m: tuple[float, ...], x_axis: tuple[float, ...], y_axis: tuple[float, ...]
) -> Frame:
    """A frame from its origin and two axes.

    Raises:
        InputError: an axis is not of unit length, or they are not at right angles.
    """
    x, y = np.asarray(x_axis, float), np.asarray(y_axis, float)
    for field, axis in (("x_axis", x), ("y_axis", y)):
        length = float(np.linalg.norm(axis))
        if abs(length - 1) > ORTHONORMAL_TOLERANCE:
            raise InputError(field, f"has length {length:.6g}, expected a unit vector")
    if abs(float(x @ y)) > ORTHONORMAL_TOLERANCE:
        raise InputError(
            "y_axis", f"is not at right angles to x_axis (their product is {float(x @ y):.6g})"
        )
    x = x / np.linalg.norm(x)
    y = y - (x @ y) * x
    y = y / np.linalg.norm(y)
    return Frame(np.asarray(origin_m, float), np.column_stack([x, y, np.cross(x, y)]))


SPECIMEN = make_frame((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""The default: the file is in the specimen's frame already."""
