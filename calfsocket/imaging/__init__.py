"""Limbs from scans, segmentations, drawings and meshes, with what the data lack from the calf."""
