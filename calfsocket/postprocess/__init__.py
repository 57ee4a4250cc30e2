"""What a solved section says: fields, contact line, quantities, thresholds."""
