"""Large-sliding frictional contact between the skin and the socket: numpy on the interface."""
