"""Exceptions of calfsocket: what went wrong, where, what is allowed, what to do."""


class CalfsocketError(Exception):
    """Base of every error that calfsocket raises on purpose; its text is for the user."""


class InputError(CalfsocketError, ValueError):
    """The user's input cannot be used; nothing was solved."""


class SolveError(CalfsocketError, RuntimeError):
    """An equilibrium was not found."""
