"""Geometry: the curves of the limb and the sockets, and the triangles made from them."""
