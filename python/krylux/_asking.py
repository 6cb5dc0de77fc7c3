"""The verbs of a laboratory: what the command line asks, as methods that return arrays."""

import numpy as np

from . import _checks, _declared


class Asking:
    """The questions that a laboratory answers; the base of :class:`krylux.Lab`."""

    def singular(self, count=6, *, part="full", photos=None, tolerance=None, confirm=None):
        """Computes singular values of one part of the light transport matrix: :meth:`eigs` with ``singular=True``.

        Returns
        -------
        krylux.answers.SingularTriplets

        References
        ----------
        Golub and Kahan, *Calculating the singular values and pseudo-inverse of a matrix*, 1965.
        """
        return self.eigs(count, part=part, photos=photos, tolerance=tolerance, confirm=confirm, singular=True)

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
        options = {"method": method, "photos": photos, "rtol": rtol, "lower": lower, "upper": upper}
        rhs = _checks.vector(b, "b", self.shape[0] * self.shape[1])
        return _declared.ask(self, "solve", options, [("values", "", rhs)])

    def relight(self, patterns=None, *, duals=None, photographs=None, photos=None, block=None, max_error=None):
        """Captures the light transport in a few dozen photos, and answers by the model; a run answers without any photo.

        Parameters
        ----------
        patterns : dict of str to array_like
            Patterns of the projector's pixels to relight with. Default: white.
        duals : dict of str to array_like
            Patterns of the camera's pixels, for dual photographs.
        photographs : dict of str to array_like
            Photos to take the interreflections out of.
        photos : int
            Photos of the capture. Default 40.
        block : int
            Patterns that are chosen beforehand; 1 is white alone. Default 12.
        max_error : float
            The largest error of a relit photo that is good enough (scenes only).

        Returns
        -------
        krylux.answers.Relighting

        References
        ----------
        O'Toole and Kutulakos, *Optical computing for fast light transport analysis* (2010).
        """
        if patterns is None:
            patterns = {"white": np.ones(self.projector_shape, np.float32)}
        asked = [
            ("patterns", patterns, self.projector_shape), ("duals", duals, self.shape),
            ("photographs", photographs, self.shape),
        ]
        arrays = [
            (field, name, _checks.picture(array, f"{field}[{name!r}]", size, self.channels))
            for field, of, size in asked for name, array in dict(of or {}).items()
        ]
        return _declared.ask(self, "relight", {"photos": photos, "block": block, "max_error": max_error}, arrays)


_declared.add_verbs(Asking)
