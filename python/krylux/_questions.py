"""From the arguments of a verb to what the native part is asked: the same for an answer and for a plan of it."""

from . import _checks


def eigs_question(*, count, which, photos, tolerance, method, block, max_basis, confirm, seed, noise=0.0, start=None,
                  deflate=()):
    """What is asked of eigenpairs."""
    return {
        "count": _checks.count(count, "count"),
        "which": which,
        "photos": _checks.count(photos, "photos"),
        "tolerance": None if tolerance is None else _checks.finite(tolerance, "tolerance", 0.0),
        "method": method,
        "block": _checks.count(block, "block"),
        "max_basis": None if max_basis is None else _checks.count(max_basis, "max_basis"),
        "noise": _checks.finite(noise, "noise", 0.0),
        "seed": _checks.count(seed, "seed", 0, 2**64 - 1),
        "start": start,
        "deflate": list(deflate),
        "confirm": confirm_share(confirm),
    }


def columns(fields):
    """Eigenvectors as columns, as SciPy has them."""
    return {**fields, "vectors": fields["vectors"].T, "imaginary_vectors": fields["imaginary_vectors"].T}


def confirm_share(share):
    """The share of the spectrum's spread beyond which no eigenvalue may be missed."""
    return _checks.maybe(_checks.finite, share, "confirm", 0.0)
