"""How a socket is put on, and what it rests on then."""

from typing import Literal, get_args

SocketSupport = Literal["floating", "outer-fixed"]
SUPPORTS: tuple[SocketSupport, ...] = get_args(SocketSupport)

Donning = Literal["gap", "expanded"]
DONNINGS: tuple[Donning, ...] = get_args(Donning)
