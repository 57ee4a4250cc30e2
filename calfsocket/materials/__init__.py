"""Laws of the tissues and of the socket."""
