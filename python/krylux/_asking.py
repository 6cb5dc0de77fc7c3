"""The verbs of a laboratory: what the command line asks, as methods that return arrays."""

from . import _checks, _declared, answers
from ._lighting import Lighting
from ._questions import columns, confirm_share, eigs_question


class Asking(Lighting):
    """The questions that a laboratory answers; the base of :class:`krylux.Lab`."""

    def eigs(self, count=6, *, part="full", which="la", photos=None, tolerance=None, method="lanczos", block=2,
             max_basis=None, confirm=None):
        """Computes eigenvalues and eigenvectors of one part of the light transport matrix.

        Parameters
        ----------
        count : int
            How many eigenpairs.
        part : str
            ``"full"``, ``"direct"`` or ``"global"`` light.
        which : str
            ``"la"``, ``"sa"``, ``"lm"``, ``"sm"``, ``"be"`` or ``"li"``, as in ARPACK.
        photos : int
            Photos to take at most. Default 50, or as many as the run that is the source might take.
        tolerance : float
            Done when each residual norm is at most this share of the matrix norm. Default 1e-8, or the photos' noise.
        method : str
            ``"lanczos"``, ``"block-lanczos"``, ``"arnoldi"`` or ``"power"``.
        block : int
            Vectors in the block of ``"block-lanczos"``.
        max_basis : int
            The most basis vectors to keep, by restarts.
        confirm : float
            Confirm that no eigenvalue was missed that lies beyond the last one by more than this share of the spectrum's spread.
            On a rig this takes further photos; matrices and traced scenes are confirmed in any case, at 0.01.

        Returns
        -------
        krylux.answers.Eigenpairs

        References
        ----------
        O'Toole and Kutulakos, section 3.
        """
        block = _checks.vectors(block, "block", self._pixels)
        question = eigs_question(count=count, which=which, photos=self._budget(photos, 50), tolerance=tolerance,
                                 method=method, block=block, max_basis=max_basis, confirm=confirm, seed=self.seed)
        fields, native = self._native.eigs(part, question)
        return answers.Eigenpairs({**columns(fields), "shape": self.projector_shape}, native, self)

    def singular(self, count=6, *, part="full", photos=None, tolerance=None, confirm=None):
        """Computes singular values of one part of the light transport matrix, with the patterns and their photos.

        They exist where camera and projector are apart, too. Every second photo is one of the transpose, with camera and
        projector exchanged.

        Parameters
        ----------
        count : int
            How many singular values, the largest first.
        part : str
            ``"full"``, ``"direct"`` or ``"global"`` light.
        photos : int
            Photos to take at most, both ways. Default 50, or as many as the run that is the source might take.
        tolerance : float
            Done when each residual is at most this share of the largest singular value. Default 1e-8, or the photos' noise.
        confirm : float
            As for :meth:`eigs`: none above ``√(σ_k² + confirm · σ_1²)`` is missed.

        Returns
        -------
        krylux.answers.SingularTriplets

        References
        ----------
        Golub and Kahan, *Calculating the singular values and pseudo-inverse of a matrix*, 1965.
        """
        tolerance = _checks.maybe(_checks.finite, tolerance, "tolerance", 0.0)
        question = (_checks.count(count, "count"), self._budget(photos, 50), tolerance, self.seed, confirm_share(confirm))
        return answers.SingularTriplets(*self._native.singular(part, question), self)

    def solve(self, b, *, method="minres", photos=50, rtol=1e-6, lower=0.0, upper=1.0):
        """Solves ``A x = b`` with the matrix of the first channel.

        Parameters
        ----------
        b : array_like
            An entry for each pixel of a photo.
        method : str
            A name of ``krylux solve --method``, such as ``"minres"``, ``"gmres"``, ``"lsqr"`` or ``"krylov-box"``.
        photos : int
            Products to take at most.
        rtol : float
            Done when ``‖b − A x‖ ≤ rtol ‖b‖``.
        lower, upper : float
            The box of the methods that keep one.

        Returns
        -------
        krylux.answers.Solution
        """
        rhs = _checks.vector(b, "b", self.shape[0] * self.shape[1])
        bounds = (_checks.finite(lower, "lower"), _checks.finite(upper, "upper"))
        question = (_checks.count(photos, "photos"), _checks.finite(rtol, "rtol", 0.0), *bounds)
        return answers.Solution(*self._native.solve(method, rhs, question), self)

    def audit(self, *, patterns=6, tolerance=0.01, asymmetry=0.1):
        """Checks that the source is the linear, symmetric operator that every other method takes it for.

        Parameters
        ----------
        patterns : int
            Random patterns; symmetry is judged by all pairs of them.
        tolerance : float
            Relative deviation from additivity, homogeneity and repeatability that passes.
        asymmetry : float
            ``‖A − Aᵀ‖/‖A‖`` that passes.

        Returns
        -------
        krylux.answers.Audit
        """
        question = (_checks.count(patterns, "patterns"), _checks.finite(tolerance, "tolerance", 0.0),
                    _checks.finite(asymmetry, "asymmetry", 0.0))
        return answers.Audit(*self._native.audit(*question), self)

    def _budget(self, photos, default):
        """The photos that were given, or those of the run, or a default."""
        return _checks.count(self._photos_of_run or default if photos is None else photos, "photos")

    @property
    def _pixels(self):
        """Pixels of a pattern."""
        return self.projector_shape[0] * self.projector_shape[1]


_declared.add_verbs(Asking)
