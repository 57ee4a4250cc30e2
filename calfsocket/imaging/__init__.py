"""Limbs from scans, segmentations and drawings, with what the data lack from the reference calf."""
