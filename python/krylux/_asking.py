"""The verbs of a laboratory: what the command line asks, as methods that return arrays."""

from . import _checks, _declared


class Asking:
    """The questions that a laboratory answers; the base of :class:`krylux.Lab`."""

    def singular(self, count=6, *, part="full", photos=None, tolerance=None, confirm=None):
        """Computes singular values of one part of the light transport matrix: :meth:`eigs` with ``singular=True``.

        References: Golub and Kahan, *Calculating the singular values and pseudo-inverse of a matrix*, 1965.
        """
        return self.eigs(count, part=part, photos=photos, tolerance=tolerance, confirm=confirm, singular=True)

    def solve(self, b, *, method="minres", photos=50, rtol=1e-6, lower=0.0, upper=1.0):
        """Solves ``A x = b`` with the matrix of the first channel.

        Args:
            b: An entry for each pixel of a photo.
            method: A name of ``krylux solve --method``, such as ``"minres"``, ``"gmres"``, ``"lsqr"`` or
                ``"krylov-box"``.
            photos: Products to take at most.
            rtol: Done when ``‖b − A x‖ ≤ rtol ‖b‖``.
            lower, upper: The box of the methods that keep one.
        """
        rhs = _checks.vector(b, "b", self.shape[0] * self.shape[1])
        options = {"method": method, "photos": photos, "rtol": rtol, "lower": lower, "upper": upper}
        return _declared.ask(self, "solve", options, [("values", "", rhs)])


_declared.add_verbs(Asking)
