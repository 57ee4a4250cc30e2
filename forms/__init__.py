"""Pure UFL: kinematics, energies of the laws, the weak form, and measures of stress and strain."""
