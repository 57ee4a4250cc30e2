"""Calibration of the combined material of muscle and fascia: section 2.2.1 of the paper."""
