"""The verbs of a laboratory: what the command line asks, as methods that return arrays."""

from . import _checks, _declared, answers


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
        bounds = (_checks.finite(lower, "lower"), _checks.finite(upper, "upper"))
        question = (_checks.count(photos, "photos"), _checks.finite(rtol, "rtol", 0.0), *bounds)
        return answers.Solution({}, *self._native.solve(method, rhs, question), self)

    def audit(self, *, patterns=6, tolerance=0.01, asymmetry=0.1):
        """Checks that the source is the linear, symmetric operator that every other method takes it for.

        Args:
            patterns: Random patterns; symmetry is judged by all pairs of them.
            tolerance: Relative deviation from additivity, homogeneity and repeatability that passes.
            asymmetry: ``‖A − Aᵀ‖/‖A‖`` that passes.
        """
        question = (_checks.count(patterns, "patterns"), _checks.finite(tolerance, "tolerance", 0.0),
                    _checks.finite(asymmetry, "asymmetry", 0.0))
        return answers.Audit({}, *self._native.audit(*question), self)

    def _budget(self, photos, default):
        """The photos that were given, or those of the run, or a default."""
        return _checks.count(self._photos_of_run or default if photos is None else photos, "photos")

    @property
    def _pixels(self):
        """Pixels of a pattern."""
        return self.projector_shape[0] * self.projector_shape[1]


_declared.add_verbs(Asking)
