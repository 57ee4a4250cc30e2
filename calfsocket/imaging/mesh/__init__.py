"""Limbs and sockets of plane meshes that were made elsewhere."""
